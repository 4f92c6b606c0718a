"""The answers of a study, from a CSV export or the database's view of its kind of trial, in one shape."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import environ
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sqlalchemy import Connection, create_engine, inspect, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError

from analysis.read.number_columns import MISSING_MARKS, numbers
from analysis.read.reading import RUN_FLAGS, RUN_TEXTS, TRIAL_PLACES, NoRatingsError, Reading
from analysis.read.text_table import categorical, read_text_table
from experiments.columns.runs import EVIDENCE_COLUMNS
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.files import with_driver


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
    """Read a CSV export, or any table with `participant`, the columns of `reading` and one a factor.

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
            rows[name] = _flags(rows[name])
    seen = _first_seen(rows)
    rows = rows.drop(columns="saved_at", errors="ignore")
    rows, chosen = _of_one_study(rows, experiment.name, study, path.name)
    return StudyAnswers(rows, path.name, (*table.decisions, *chosen), seen)


def stored_at() -> str:
    """DATABASE_URL, or the SQLite file in the server's data folder (PALPEBRA_DATA_FOLDER, else `data`)."""
    if environ.get("DATABASE_URL"):
        return environ["DATABASE_URL"]
    folder = environ.get("PALPEBRA_DATA_FOLDER") or "data"
    return f"sqlite:///{Path(folder) / 'palpebra.sqlite'}"


def load_database(
    url: str, experiment: Experiment, reading: Reading, study: str | None = None, whole: bool = False
) -> StudyAnswers:
    """Read the study's rows from the SQL view of its kind; `whole` adds what only slow parts need.

    Raises
    ------
    NoRatingsError
        No database there, no such view yet, or no row of this experiment.
    InputError
        A URL that cannot be used, or several studies and no `study` to choose one.
    """
    # SQLAlchemy takes as long to import as numpy, and a CSV needs none of it

    query = AnswersQuery(url, reading, experiment.name, study)
    try:
        rows = query.rows(reading.further if whole else (), experiment.factor_names)
        if rows.empty:
            if study:
                raise NoRatingsError(
                    f"{query.name} has no ratings of experiment '{experiment.name}' in a study '{study}'; "
                    "give the definition that this study has, and its name as `server study list` shows it"
                )
            raise NoRatingsError(
                f"experiment '{experiment.name}' has no ratings yet in {query.name}; practice does not count"
            )
        rows, chosen = _of_one_study(rows, experiment.name, study, query.name)
        return StudyAnswers(rows, query.name, chosen, query.first_seen() if _runs_again(rows) else {})
    finally:
        query.close()


def _has_no_rows(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return bool(file.readline().strip()) and not file.read(64).strip()


def _flags(column: pd.Series) -> NDArray[np.bool_]:
    yes = [text for text in column.cat.categories if str(text).casefold() in {"1", "true", "yes"}]
    return column.isin(yes).to_numpy()


def _first_seen(rows: pd.DataFrame) -> dict[str, str]:
    if not {"run", "saved_at"} <= set(rows.columns) or not _runs_again(rows):
        return {}
    first = rows[["run", "saved_at"]].astype(str).groupby("run", observed=True)["saved_at"].min()
    return {str(run): str(moment) for run, moment in first.items()}


def _runs_again(rows: pd.DataFrame) -> bool:
    if "run" not in rows.columns:
        return False
    return bool(rows.groupby("participant", observed=True)["run"].nunique().max() > 1)


def _of_one_study(
    rows: pd.DataFrame, experiment: str, study: str | None, source: str
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    decisions: list[str] = []
    if "experiment" in rows.columns:
        rows = _only(rows, "experiment", experiment, source, decisions)
    if study is not None:
        if "study" not in rows.columns:
            raise InputError(f"{source} has no column 'study'; leave --study out")
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
    decisions.append(f"{(~mine).sum()} rows of other {column} values left aside")
    return rows[mine]


def _names(column: Iterable[object]) -> list[str]:
    return sorted({str(name) for name in pd.unique(pd.Series(column))})


# Rows of the SQL view of a kind of trial, read in portions straight into columns of codes.

PORTION = 20_000
KINDS = ("main", "attention")
"""Practice trials are never fetched: nobody analyses them."""


class AnswersQuery:
    """A read-only look at the answers of one experiment."""

    def __init__(self, url: str, reading: Reading, experiment: str, study: str | None) -> None:
        self._reading, self._view = reading, reading.view.name
        self.name = _describe(url)
        self._values = {"experiment": experiment, **({"study": study} if study else {})}
        self._where = "experiment = :experiment" + (" AND study = :study" if study else "")
        self._engine = create_engine(with_driver(url))
        self._connection = self._open()

    def _open(self) -> Connection:
        location = self._engine.url
        file = location.database if location.get_backend_name() == "sqlite" else None
        if file and file != ":memory:" and not Path(file).is_file():
            raise NoRatingsError(
                f"there is no database at {file}; run a study first, or name one with --database or --csv"
            )
        try:
            connection = self._engine.connect()
            if self._view not in inspect(connection).get_view_names():
                raise NoRatingsError(
                    f"{self.name} has no view '{self._view}'; start the server once to make it"
                )
        except DBAPIError as error:
            raise InputError(f"cannot read {self.name}: {_first_line(error)}") from error
        return connection

    def close(self) -> None:
        """Let go of the database."""
        self._connection.close()
        self._engine.dispose()

    def rows(self, further: Sequence[str], factors: Sequence[str]) -> pd.DataFrame:
        """Main and attention rows: text as categories, numbers float, a column a factor, a run's columns.

        The columns of a run (`RUN_TEXTS`, `RUN_FLAGS`) are fetched once a run, not once a row.
        """
        texts, numbers = self._reading.all_texts, (*self._reading.all_numbers, *further)
        levels = ("levels",) if self._reading.has_levels else ()
        names = [*texts, *numbers, *levels]
        codes = {name: _Codes() for name in (*texts, *levels)}
        values = {name: _Numbers() for name in numbers}
        kinds = ", ".join(f"'{kind}'" for kind in KINDS)
        for portion in self._portions(
            f"{', '.join(names)} FROM {self._view} WHERE {self._where} AND kind IN ({kinds})"
        ):
            for name, column in zip(names, zip(*portion, strict=True), strict=True):
                (codes if name in codes else values)[name].add(column)
        columns: dict[str, Any] = {name: codes[name].column() for name in texts}
        columns |= {name: values[name].column() for name in numbers}
        if levels:
            columns |= _factor_columns(codes["levels"].column(), factors)
        return pd.DataFrame(columns | self._of_runs(columns["run"]))

    def _of_runs(self, run: "pd.Categorical[str]") -> dict[str, Any]:
        """The columns of every row's run."""
        there = self._reading.view.names
        texts, flags = ([name for name in names if name in there] for names in (RUN_TEXTS, RUN_FLAGS))
        names = ["run", *texts, *flags]
        rows_of_runs = [
            row
            for rows in self._portions(f"DISTINCT {', '.join(names)} FROM {self._view} WHERE {self._where}")
            for row in rows
        ]
        of_run = {str(row[0]): row[1:] for row in rows_of_runs}
        of_category = [of_run[name] for name in run.categories]
        taken = run.codes.astype(np.int64)
        columns: dict[str, Any] = {}
        for i, name in enumerate(texts):
            columns[name] = categorical(taken, ["" if row[i] is None else str(row[i]) for row in of_category])
        for i, name in enumerate(flags, len(texts)):
            columns[name] = np.array([bool(row[i]) for row in of_category], dtype=bool)[taken]
        return columns

    def first_seen(self) -> dict[str, str]:
        """When the first row of each run was stored."""
        portions = self._portions(f"run, MIN(saved_at) FROM {self._view} WHERE {self._where} GROUP BY run")
        return {str(run): str(moment) for rows in portions for run, moment in rows}

    def _portions(self, selection: str) -> Iterator[Sequence[Any]]:
        # the driver's own cursor: SQLAlchemy's row objects cost a second a million rows
        query = text(f"SELECT {selection}").bindparams(**self._values)
        sql = query.compile(self._engine, compile_kwargs={"literal_binds": True})
        cursor = self._connection.connection.cursor()
        try:
            cursor.execute(str(sql))
            while portion := cursor.fetchmany(PORTION):
                yield portion
        finally:
            cursor.close()


class _Codes:
    """Text seen in portions, as codes into the names found."""

    def __init__(self) -> None:
        self._code: dict[str | None, int] = {}
        self._portions: list[np.ndarray[Any, Any]] = []

    def add(self, values: Sequence[Any]) -> None:
        code = self._code
        self._portions.append(np.array([code.setdefault(value, len(code)) for value in values], np.int32))

    def column(self) -> "pd.Categorical[str]":
        texts = ["" if name is None else str(name) for name in self._code]
        codes = np.concatenate(self._portions) if self._portions else np.empty(0, np.int32)
        return categorical(codes, texts)


class _Numbers:
    """Numbers seen in portions; NULL is NaN."""

    def __init__(self) -> None:
        self._portions: list[np.ndarray[Any, Any]] = []

    def add(self, values: Sequence[Any]) -> None:
        self._portions.append(np.array(values, np.float64))

    def column(self) -> np.ndarray[Any, Any]:
        return np.concatenate(self._portions) if self._portions else np.empty(0)


def _factor_columns(levels: "pd.Categorical[str]", factors: Sequence[str]) -> dict[str, Any]:
    """A column a factor from the JSON objects in `levels`; empty where a row has none."""
    parsed = [json.loads(level) if level else {} for level in levels.categories]
    columns: dict[str, Any] = {}
    for factor in factors:
        texts = [str((row or {}).get(factor, "")) for row in parsed]
        names = sorted(set(texts))
        lookup = np.array([names.index(name) for name in texts], np.int32)
        columns[factor] = pd.Categorical.from_codes(
            lookup[levels.codes], categories=pd.Index(names, dtype=object)
        )
    return columns


def _describe(url: str) -> str:
    """The database in words, without a password."""
    try:
        parsed = make_url(with_driver(url))
        parsed.get_dialect()
    except (ArgumentError, NoSuchModuleError) as error:
        raise InputError(
            f"'{url}' is no database URL; expected e.g. sqlite:///data/palpebra.sqlite"
        ) from error
    if parsed.get_backend_name() == "sqlite":
        return Path(parsed.database or ":memory:").name
    return f"database {parsed.database} on {parsed.host}"


def _first_line(error: DBAPIError) -> str:
    return str(error.orig).strip().splitlines()[0]


# The runs CSV (`server export --format runs`): the verdict on each run, and the signals behind it.

VERDICT = "evidence_verdict"


@dataclass(frozen=True)
class RunEvidence:
    """Verdict of each run by its name, and the signals as columns of numbers, NaN for none."""

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
