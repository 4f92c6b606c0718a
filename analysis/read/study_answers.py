"""The answers of a study, from a CSV export or the database's view of its kind of trial, in one shape."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.read.number_columns import MISSING_MARKS, numbers
from analysis.read.reading import RUN_FLAGS, RUN_TEXTS, TRIAL_PLACES, NoRatingsError, Reading
from analysis.read.text_table import flags, read_text_table
from experiments.columns.runs import EVIDENCE_COLUMNS
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from table_files import counted


@dataclass(frozen=True)
class StudyAnswers:
    """Every row of one study, in columns of text (categorical), numbers (float) and flags (bool).

    A column the source does not have is absent here. `first_seen` is when each run's first row was stored.
    """

    rows: pd.DataFrame
    source: str
    decisions: tuple[str, ...]
    first_seen: Mapping[str, str]

    @property
    def synthetic(self) -> bool:
        """True where any row was given by no person."""
        return "synthetic" in self.rows.columns and bool(self.rows["synthetic"].any())


def load_csv(path: Path, experiment: Experiment, reading: Reading, study: str | None = None) -> StudyAnswers:
    """Read a CSV export, or any table with `participant`, the columns of `reading` and one per factor.

    Raises
    ------
    NoRatingsError
        A header and no rows.
    InputError
        As `read_text_table`; numbers that are text; another experiment's data.
    """
    factors = experiment.factor_names if reading.has_levels else ()
    read_as_numbers = (*TRIAL_PLACES, *reading.further, *reading.all_numbers)
    optional = [*reading.all_texts, *RUN_TEXTS, *read_as_numbers, *RUN_FLAGS, "saved_at"]
    if _has_no_rows(path):
        raise NoRatingsError(f"{path.name} has a header but no ratings yet")
    table = read_text_table(path, ["participant", *reading.texts, *reading.numbers, *factors], optional)
    rows = table.columns
    for name in read_as_numbers:
        if name in rows.columns:
            rows[name] = numbers(table, name)
    for name in RUN_FLAGS:
        if name in rows.columns:
            rows[name] = flags(rows[name], path.name)
    seen = _first_seen(rows, path.name)
    rows = rows.drop(columns="saved_at", errors="ignore")
    rows, chosen = of_one_study(rows, experiment.name, study, path.name)
    return StudyAnswers(rows, path.name, (*table.decisions, *chosen), seen)


def _has_no_rows(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return bool(file.readline().strip()) and not file.read(64).strip()


def _first_seen(rows: pd.DataFrame, source: str) -> dict[str, str]:
    if not {"run", "saved_at"} <= set(rows.columns) or not took_part_again(rows):
        return {}
    words = rows["saved_at"].astype(str)
    words = words[~words.isin(MISSING_MARKS)]
    times = pd.to_datetime(words, format="ISO8601", utc=True, errors="coerce")
    if times.isna().any():
        raise InputError(
            f"{source}: 'saved_at' is '{words[times.isna()].iloc[0]}' in a row; expected a time such as "
            "2026-11-30T09:05:00Z, year first. It decides which run of a participant is the first"
        )
    first = times.groupby(rows["run"].astype(str)).min()
    return {str(run): moment.isoformat() for run, moment in first.items()}


def took_part_again(rows: pd.DataFrame) -> bool:
    """Whether any participant has several runs."""
    if "run" not in rows.columns:
        return False
    return bool(rows.groupby("participant", observed=True)["run"].nunique().max() > 1)


def of_one_study(
    rows: pd.DataFrame, experiment: str, study: str | None, source: str
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The rows of this experiment and study, and what was ignored; InputError where the study is unclear."""
    decisions: list[str] = []
    if "experiment" in rows.columns:
        rows = _only(rows, "experiment", experiment, source, decisions)
    if study is not None:
        if "study" not in rows.columns:
            raise InputError(f"{source} has no column 'study'; omit --study")
        rows = _only(rows, "study", study, source, decisions)
    elif "study" in rows.columns and len(names := _names(rows["study"])) > 1:
        raise InputError(f"{source} holds {len(names)} studies; choose one with --study: {', '.join(names)}")
    return rows, tuple(decisions)


def _only(rows: pd.DataFrame, column: str, name: str, source: str, decisions: list[str]) -> pd.DataFrame:
    names = _names(rows[column])
    if name not in names:
        raise InputError(f"{source} holds {column} {', '.join(names) or 'nothing'}, not '{name}'")
    if len(names) == 1:
        return rows
    mine = (rows[column] == name).to_numpy()
    number = int((~mine).sum())
    other = counted(number, "row")
    decisions.append(f"{other} with other {column} values {'was' if number == 1 else 'were'} ignored")
    return rows[mine]


def _names(column: Iterable[object]) -> list[str]:
    return sorted({str(name) for name in pd.unique(pd.Series(column))})


# The runs CSV (`server export --format runs`): the verdict on each run, and the signals behind it.

VERDICT = "evidence_verdict"


@dataclass(frozen=True)
class RunEvidence:
    """Verdict of each run by name, and the signals as columns of numbers, NaN for none."""

    verdicts: dict[str, str]
    signals: pd.DataFrame


def read_runs(path: Path) -> RunEvidence:
    """Read the columns on evidence of a runs CSV.

    Raises
    ------
    InputError
        As `read_text_table`: no file, or no columns `run` and `evidence_verdict`.
    """
    names = [column.name for column in EVIDENCE_COLUMNS]
    rows = read_text_table(path, ["run", VERDICT], names, copies=False).columns
    runs = rows["run"].astype(str).tolist()
    signals = {name: _numbers(rows[name].astype(str)) for name in names if name in rows.columns}
    return RunEvidence(
        dict(zip(runs, rows[VERDICT].astype(str), strict=True)),
        pd.DataFrame(signals, index=pd.Index(runs, name="run")),
    )


def _numbers(column: pd.Series) -> np.ndarray:
    return np.array([np.nan if text in MISSING_MARKS else float(text) for text in column])


def with_verdicts(answers: StudyAnswers, runs: RunEvidence) -> StudyAnswers:
    """The answers with the verdicts of the runs file, which were given when it was written."""
    if "run" not in answers.rows.columns:
        return answers
    verdicts = answers.rows["run"].astype(str).map(runs.verdicts).fillna("not_judged")
    return replace(answers, rows=answers.rows.assign(**{VERDICT: pd.Categorical(verdicts)}))
