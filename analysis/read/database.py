"""A study's answers and definitions from the server's database; rows are read in portions into codes."""

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sqlalchemy import Connection, bindparam, create_engine, inspect, text
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError

from analysis.read.pool import DECLARATION, SERIES, VERSION
from analysis.read.reading import RUN_FLAGS, RUN_TEXTS, NoRatingsError, Reading
from analysis.read.study_answers import StudyAnswers, of_one_study, took_part_again
from analysis.read.text_table import categorical
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.files import with_driver
from experiments.rules.exclusions import ScreensRaters
from table_files import counted, nearest

PORTION = 20_000
KINDS = ("main", "attention")
"""Practice trials are never fetched: nobody analyses them."""
_KINDS = ", ".join(f"'{kind}'" for kind in KINDS)


# Decision 0723: `--version N` means the answers given under version N.
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
    query = AnswersQuery(url, reading, experiment.name, study)
    try:
        # raters are compared clip by clip, exemplars apart
        whole = whole or any(isinstance(rule, ScreensRaters) for rule in experiment.exclusions)
        rows = query.rows(reading.further if whole else (), experiment.factor_names)
        if rows.empty:
            if study:
                raise NoRatingsError(
                    f"{query.name} has no ratings of experiment '{experiment.name}' in a study '{study}'; "
                    "use this study's definition and its name as shown by `server study list`"
                )
            raise NoRatingsError(
                f"experiment '{experiment.name}' has no ratings yet in {query.name}; practice does not count"
            )
        rows, chosen = of_one_study(rows, experiment.name, study, query.name)
        # Asked for only where somebody has two runs, since it goes through the view once more.
        return StudyAnswers(rows, query.name, chosen, query.first_seen() if took_part_again(rows) else {})
    finally:
        query.close()


def answered_versions(url: str, experiment: Experiment, reading: Reading, study: str | None) -> pd.DataFrame:
    """`AnswersQuery.versions` of this database; raises as `load_database`, but not where there is no row."""
    query = AnswersQuery(url, reading, experiment.name, study)
    try:
        return query.versions(experiment.trial.kind)
    finally:
        query.close()


class AnswersQuery:
    """A read-only look at the answers of one experiment."""

    def __init__(self, url: str, reading: Reading, experiment: str, study: str | None) -> None:
        self._reading, self._view = reading, reading.view.name
        self.name = database_name(url)
        self._values = {"experiment": experiment, **({"study": study} if study else {})}
        self._where = "experiment = :experiment" + (" AND study = :study" if study else "")
        self._engine = create_engine(with_driver(url))
        # If a step fails, what the steps before it have opened is closed.
        with ExitStack() as opened:
            opened.callback(self._engine.dispose)
            self._connection = self._open(opened)
            self._opened = opened.pop_all()

    def _open(self, opened: ExitStack) -> Connection:
        if file := missing_file(self._engine.url):
            raise NoRatingsError(
                f"there is no database at {file}; set PALPEBRA_DATA_FOLDER to the server's data folder, or "
                "use --database or --csv"
            )
        try:
            connection = opened.enter_context(self._engine.connect())
            if self._view not in inspect(connection).get_view_names():
                raise NoRatingsError(
                    f"{self.name} has no view '{self._view}'; start the server once to create it"
                )
        except DBAPIError as error:
            raise InputError(f"cannot read {self.name}: {_first_line(error.orig)}") from error
        return connection

    def close(self) -> None:
        """Close the connection to the database."""
        self._opened.close()

    def rows(self, further: Sequence[str], factors: Sequence[str]) -> pd.DataFrame:
        """Main and attention rows: text as categories, numbers float, a column per factor, a run's columns.

        The columns of a run (`RUN_TEXTS`, `RUN_FLAGS`) are fetched once per run, not once per row.
        """
        texts, numbers = self._reading.all_texts, (*self._reading.all_numbers, *further)
        levels = ("levels",) if self._reading.has_levels else ()
        names = [*texts, *numbers, *levels]
        codes = {name: _Codes() for name in (*texts, *levels)}
        values = {name: _Numbers() for name in numbers}
        for portion in self._portions(
            f"{', '.join(names)} FROM {self._view} WHERE {self._where} AND kind IN ({_KINDS})"
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

    def versions(self, kind: str) -> pd.DataFrame:
        """Study, version, series, declaration, origin and `trial_kind` of the answers, of whatever kind.

        One row per combination; the other columns are called as in the views. `kind` is that of this view.
        """
        # Per run and not per answer: a view would read every answer for these few rows.
        query = text(
            "SELECT DISTINCT s.name, v.number, v.series, v.definition_sha256, r.origin, "
            "(SELECT t.kind FROM trial_ratings t JOIN assigned_trials a "
            "ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index "
            "WHERE t.study_run_id = r.id AND a.kind IN :kinds LIMIT 1) FROM study_runs r "
            "JOIN study_versions v ON v.id = r.version_id JOIN studies s ON s.id = r.study_id "
            "WHERE v.experiment = :experiment AND r.origin <> 'preview' AND r.erased_at IS NULL"
        ).bindparams(bindparam("kinds", KINDS, expanding=True))
        names, study = ("study", VERSION, SERIES, DECLARATION, "run_origin"), self._values.get("study")
        try:
            answered = self._connection.execute(query, {"experiment": self._values["experiment"]})
            # All answers of a run are of one kind; a run without any has none.
            rows = [tuple(row) for row in answered if study in (None, row[0]) and row[-1] is not None]
        except DBAPIError:
            # Without row security a user may have rights on the view alone, which has answers of one kind.
            self._connection.rollback()
            counting = f"{self._where} AND kind IN ({_KINDS})"
            portions = self._portions(f"DISTINCT {', '.join(names)} FROM {self._view} WHERE {counting}")
            rows = [(*row, kind) for portion in portions for row in portion]
        return pd.DataFrame(rows, columns=[*names, "trial_kind"])

    def first_seen(self) -> dict[str, str]:
        """When the first row of each run was stored."""
        portions = self._portions(f"run, MIN(saved_at) FROM {self._view} WHERE {self._where} GROUP BY run")
        return {str(run): str(moment) for rows in portions for run, moment in rows}

    def _portions(self, selection: str) -> Iterator[Sequence[Any]]:
        # the driver's own cursor: SQLAlchemy's row objects cost one second per million rows
        query = text(f"SELECT {selection}").bindparams(**self._values)
        # The driver's cursor does not know these parameters: the dialect writes their values into the text.
        sql = query.compile(self._engine, compile_kwargs={"literal_binds": True})
        cursor = self._connection.connection.cursor()
        try:
            cursor.execute(str(sql))
            while portion := cursor.fetchmany(PORTION):
                yield portion
        except self._engine.dialect.loaded_dbapi.Error as error:
            raise InputError(
                f"cannot read {self.name}: {_first_line(error)}; if it is of an older version, `server "
                "database upgrade` or a start of the server upgrades it"
            ) from error
        finally:
            cursor.close()


def stored_definition(url: str, study: str, series: int | None, version: int | None) -> str | None:
    """The TOML text of a study in this database: the newest version of the only, or the given, data series.

    None if there is no such database file or study.

    Raises
    ------
    InputError
        A URL that cannot be used, a database without connection or with tables that cannot be read, a series
        or version that the study does not have, or several data series and none given: their definitions
        differ.
    """
    rows = _selected(
        url,
        "v.number, v.series, v.definition_toml FROM study_versions v "
        "JOIN studies s ON s.id = v.study_id WHERE s.name = :study ORDER BY v.number",
        study,
    )
    if not rows:
        return None
    every = sorted({row[1] for row in rows})
    if version is None and series is None and len(every) > 1:
        options = " or ".join(f"--series {number}" for number in every)
        raise InputError(
            f"study '{study}' has {len(every)} data series with different definitions; choose one with "
            f"{options}"
        )
    fits = [row for row in rows if version in (None, row[0]) and series in (None, row[1])]
    if not fits:
        asked = {"version": version, "data series": series}
        of = " in ".join(f"{what} {number}" for what, number in asked.items() if number is not None)
        raise InputError(
            f"study '{study}' has no {of}; it has {counted(len(rows), 'version')} in {len(every)} data series"
        )
    return str(fits[-1][2])


MAX_NAMES = 10


def said_of_studies(url: str, name: str, others: Sequence[str]) -> tuple[str, bool]:
    """Why a database has no study of this name, in a sentence, and whether it is all that there is to say.

    Parameters
    ----------
    others : sequence of str
        Names of shipped experiments: one of these may be the nearest.
    """
    if file := missing_file(make_url(with_driver(url))):
        hint = "set PALPEBRA_DATA_FOLDER to the server's data folder, or use --database"
        return f"There is no database at {file} to look for a study in; {hint}", False
    names = [str(row[0]) for row in _selected(url, "name FROM studies ORDER BY name", name)]
    where = database_name(url)
    if not names:
        return f"No studies were found in {where}", False
    near = nearest(name, [*names, *others], cutoff=0.6)
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    listed = f"Studies in {where}: {', '.join(names[:MAX_NAMES])}{more}"
    if near in names:
        return f"did you mean '{near}'? {listed}", True
    return listed, False


def missing_file(url: URL) -> str | None:
    """The SQLite file of a URL if it does not exist."""
    file = url.database if url.get_backend_name() == "sqlite" else None
    return file if file and file != ":memory:" and not Path(file).is_file() else None


def _selected(url: str, selection: str, study: str) -> list[tuple[Any, ...]]:
    """Rows of the server's own tables; none where there is no such database.

    Raises
    ------
    InputError
        A URL that cannot be used, a database without connection, or tables that cannot be read.
    """
    name = database_name(url)
    engine = create_engine(with_driver(url))
    if missing_file(engine.url):
        return []
    try:
        with engine.connect() as connection:
            return [tuple(row) for row in connection.execute(text(f"SELECT {selection}"), {"study": study})]
    except DBAPIError as error:
        raise InputError(
            f"'{study}' is not a shipped experiment, and studies cannot be looked up: cannot read {name}: "
            f"{_first_line(error.orig)}"
        ) from error
    finally:
        engine.dispose()


class _Codes:
    """Text seen in portions, as codes into the names found."""

    def __init__(self) -> None:
        self._code: dict[str | None, int] = {}
        self._portions: list[np.ndarray[Any, Any]] = []

    def add(self, values: Sequence[Any]) -> None:
        code = self._code
        # Codes in the order of appearance: names are sorted once at the end.
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
    """A column per factor from the JSON objects in `levels`; empty where a row has none."""
    # Once per distinct text: a design has few cells, however many rows there are.
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


def database_name(url: str) -> str:
    """The database in words, without a password; InputError for a URL that cannot be used."""
    try:
        parsed = make_url(with_driver(url))
        parsed.get_dialect()
    except (ArgumentError, NoSuchModuleError) as error:
        raise InputError(
            f"'{url}' is not a database URL; expected, for example, sqlite:///data/palpebra.sqlite"
        ) from error
    if parsed.get_backend_name() == "sqlite":
        return Path(parsed.database or ":memory:").name
    return f"database {parsed.database} on {parsed.host}"


def _first_line(error: BaseException | None) -> str:
    return str(error).strip().splitlines()[0]
