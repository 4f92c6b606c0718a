"""Whose answers are analysed together: one origin, one data series."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pandas as pd

from experiments.errors import InputError


class Origin(StrEnum):
    """Where answers come from, and `all` of them pooled."""

    PARTICIPANT = "participant"
    PILOT = "pilot"
    SIMULATED = "simulated"
    ALL = "all"


@dataclass(frozen=True)
class Pool:
    """What is wanted of a study's rows; None leaves the choice to the rows themselves."""

    origin: Origin | None = None
    series: int | None = None
    version: int | None = None


def pooled(rows: pd.DataFrame, pool: Pool, source: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The rows of this pool, and in words which they are and what was left aside.

    Without a wish the origin is the first of participant, pilot and simulated that there is, and the series
    the latest; rows of others are left aside and counted. Sources without these columns (exports of older
    programs) tell the origin by `phase` and `synthetic`, and have one series.

    Raises
    ------
    InputError
        A series or version that the rows do not have.
    """
    said: list[str] = []
    rows = _of_origin(rows, pool.origin, said)
    rows = _of_number(rows, "study_version", pool.version, source, said)
    latest = pool.series
    if latest is None and "data_series" in rows.columns and len(numbers := _numbers(rows["data_series"])) > 1:
        latest = max(numbers)
    return _of_number(rows, "data_series", latest, source, said), tuple(said)


def origins(rows: pd.DataFrame) -> np.ndarray:
    """The origin of every row."""
    if "run_origin" in rows.columns and not (rows["run_origin"] == "").all():
        return np.asarray(rows["run_origin"], dtype=object)
    found = np.full(len(rows), Origin.PARTICIPANT.value, dtype=object)
    if "phase" in rows.columns:
        found[(rows["phase"] == "pilot").to_numpy()] = Origin.PILOT.value
    if "synthetic" in rows.columns:
        found[rows["synthetic"].to_numpy(dtype=bool)] = Origin.SIMULATED.value
    return found


def _of_origin(rows: pd.DataFrame, wanted: Origin | None, said: list[str]) -> pd.DataFrame:
    found = origins(rows)
    there = [origin for origin in Origin if (found == origin.value).any()]
    if wanted is Origin.ALL:
        if len(there) > 1:
            said.append(f"answers of {len(there)} origins pooled: {', '.join(there)}")
        return rows
    origin = wanted or (there[0] if there else Origin.PARTICIPANT)
    mine = found == origin.value
    if not mine.all():
        said.append(f"origin {origin}: {(~mine).sum()} rows of other origins left aside")
    return rows if mine.all() else rows[mine]


def _of_number(
    rows: pd.DataFrame, column: str, wanted: int | None, source: str, said: list[str]
) -> pd.DataFrame:
    what = column.replace("_", " ")
    if wanted is None or rows.empty:
        return rows
    there = _numbers(rows[column]) if column in rows.columns else []
    if not there:
        raise InputError(f"{source} does not say the {what} of its rows; leave the choice of one out")
    if wanted not in there:
        raise InputError(f"{source} has no {what} {wanted}, but {', '.join(map(str, there))}")
    if len(there) == 1:
        return rows
    mine = (rows[column].astype(str) == str(wanted)).to_numpy()
    said.append(f"{what} {wanted}: {(~mine).sum()} rows of others left aside")
    return rows[mine]


def _numbers(column: pd.Series) -> list[int]:
    return sorted({int(float(str(word))) for word in pd.unique(column) if str(word) not in ("", "nan")})
