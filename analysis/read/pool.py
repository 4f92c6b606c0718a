"""Whose answers are analyzed together: one origin, one data series."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.errors import InputError
from table_files import counted

VERSION, SERIES = "study_version", "data_series"
"""The columns with the version of the study under which an answer was given, and that version's series."""
DECLARATION = "definition_sha256"
"""The column with the hash of the declaration under which an answer was given."""


class Origin(StrEnum):
    """Where answers come from, and `all` of them pooled."""

    PARTICIPANT = "participant"
    PILOT = "pilot"
    SIMULATED = "simulated"
    ALL = "all"


@dataclass(frozen=True)
class Pool:
    """The rows of a study to analyze; None: chosen from the rows.

    A `version` is the answers given under it alone, a `series` those of all versions that measure the same.
    """

    origin: Origin | None = None
    series: int | None = None
    version: int | None = None

    def __str__(self) -> str:
        """What was asked for, in words: ` of origin 'pilot' in data series 2`; empty where nothing was."""
        origin = f" of origin '{self.origin}'" if self.origin else ""
        series = f" in data series {self.series}" if self.series else ""
        return origin + series + (f" under version {self.version}" if self.version else "")


class PooledRows(NamedTuple):
    """The rows of a pool, in words which they are, and the rows of other origins."""

    rows: pd.DataFrame
    decisions: tuple[str, ...]
    set_aside: tuple[str, ...]


def pooled(rows: pd.DataFrame, pool: Pool, source: str, declaration_sha256: str) -> PooledRows:
    """The rows of this pool, and in words which they are and what was left aside.

    If no origin is given, it is the first of participant, pilot and simulated that occurs in the rows (of the
    version or series asked for). If no series is given, it is the latest with answers under the declaration
    with this hash, else the latest of all. Other rows are ignored and counted. Sources without these columns
    (exports of older programs) have the origin in `phase` and `synthetic`, and have one series.

    Raises
    ------
    InputError
        A series or version that the rows do not have.
    """
    said: list[str] = []
    aside: list[str] = []
    # What was asked for first: the default origin is that of the rows which remain.
    rows = _of_number(rows, VERSION, pool.version, source, said)
    rows = _of_number(rows, SERIES, pool.series, source, said)
    rows = _of_origin(rows, pool.origin, said, aside)
    # The series last: the latest one depends on the version and on the origin.
    rows = _of_number(rows, SERIES, _series_of(rows, declaration_sha256), source, said)
    decisions = (*_named(rows, pool), *said, *_declarations(rows, declaration_sha256))
    return PooledRows(rows, decisions, tuple(aside))


def _named(rows: pd.DataFrame, pool: Pool) -> Iterator[str]:
    if SERIES in rows.columns and len(series := _numbers(rows[SERIES])) == 1:
        alone = f", only version {pool.version}" if pool.version else ""
        origin = " and ".join(pd.unique(origins(rows)))
        yield f"{origin} responses, data series {series[0]}{alone}"


def _series_of(rows: pd.DataFrame, declaration_sha256: str) -> int | None:
    if SERIES not in rows.columns:
        return None
    series = rows[SERIES]
    if DECLARATION in rows.columns:
        # Answers under this very declaration fit its analysis plan best.
        own = _numbers(series[(rows[DECLARATION] == declaration_sha256).to_numpy()])
        if own:
            return own[-1]
    return max(_numbers(series), default=None)


def _declarations(rows: pd.DataFrame, declaration_sha256: str) -> Iterator[str]:
    """What is to be said of the declarations under which these answers were given."""
    hashes = (
        # Rows of older exports may have no hash.
        {str(name) for name in pd.unique(rows[DECLARATION])} - {""} if DECLARATION in rows.columns else set()
    )
    if len(hashes) > 1:
        yield f"{len(hashes)} versions of the experiment's declaration were used and analyzed together"
    if hashes and declaration_sha256 not in hashes:
        yield (
            "the responses were given under a different declaration than the one used here; find theirs on "
            "the study's Design page"
        )


def origins(rows: pd.DataFrame) -> np.ndarray:
    """The origin of every row."""
    # A column that is empty throughout says nothing.
    if "run_origin" in rows.columns and not (rows["run_origin"] == "").all():
        return np.asarray(rows["run_origin"], dtype=object)
    origin = np.full(len(rows), Origin.PARTICIPANT.value, dtype=object)
    if "phase" in rows.columns:
        origin[(rows["phase"] == "pilot").to_numpy()] = Origin.PILOT.value
    if "synthetic" in rows.columns:
        # Last: synthetic answers may be marked as of a pilot, too.
        origin[rows["synthetic"].to_numpy(dtype=bool)] = Origin.SIMULATED.value
    return origin


def _of_origin(rows: pd.DataFrame, chosen: Origin | None, said: list[str], aside: list[str]) -> pd.DataFrame:
    origin_of_row = origins(rows)
    there = [origin for origin in Origin if (origin_of_row == origin.value).any()]
    if chosen is Origin.ALL:
        if len(there) > 1:
            said.append(f"responses of {len(there)} origins were pooled: {', '.join(there)}")
        return rows
    # The order of `Origin`: participants before pilots before simulations.
    origin = chosen or (there[0] if there else Origin.PARTICIPANT)
    mine = origin_of_row == origin.value
    if not mine.all():
        said.append(f"only responses of origin {origin} were analyzed")
        aside.append(f"{counted(int((~mine).sum()), 'row')} of other origins")
    return rows if mine.all() else rows[mine]


def _of_number(
    rows: pd.DataFrame, column: str, chosen: int | None, source: str, said: list[str]
) -> pd.DataFrame:
    what = column.replace("_", " ")
    if chosen is None or rows.empty:
        return rows
    there = _numbers(rows[column]) if column in rows.columns else []
    if not there:
        raise InputError(f"{source} does not record the {what} of its rows; do not choose one")
    if chosen not in there:
        raise InputError(f"{source} has no responses of {what} {chosen}; it has {_known(rows)}")
    # Nothing is left aside, so nothing is said.
    if len(there) == 1:
        return rows
    # As text, since a column with empty cells holds no whole numbers.
    mine = (rows[column].astype(str) == str(chosen)).to_numpy()
    number = int((~mine).sum())
    said.append(f"{what} {chosen}: {counted(number, 'other row')} {'was' if number == 1 else 'were'} ignored")
    return rows[mine]


def _known(rows: pd.DataFrame) -> str:
    """The series of these rows with their versions, in words."""
    if VERSION not in rows.columns or SERIES not in rows.columns:
        # A table may have only one of the two columns.
        column = VERSION if VERSION in rows.columns else SERIES
        return f"{column.replace('_', ' ')} {', '.join(map(str, _numbers(rows[column])))}"
    groups = rows[[SERIES, VERSION]].drop_duplicates().groupby(SERIES)[VERSION]
    versions = {str(series): _numbers(numbers) for series, numbers in groups}
    return ", ".join(
        f"data series {series} (version{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))})"
        for series, numbers in versions.items()
    )


def _numbers(column: pd.Series) -> list[int]:
    return sorted({int(float(str(word))) for word in pd.unique(column) if str(word) not in ("", "nan")})
