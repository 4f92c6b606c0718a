"""The wide table: one row a run, and a column a cell of the design with the run's mean rating in it."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, product
from operator import itemgetter
from typing import Any

from sqlalchemy.orm import Session

from experiments.columns import RUN_COLUMNS, Column
from experiments.columns.form_columns import FormColumn, run_columns
from experiments.columns.names import plain_name, unlike
from experiments.definition import Experiment
from experiments.design import rated_levels
from experiments.errors import InputError
from experiments.trials.scales import RatedScale, scales_of
from server.export.extract import Extract
from server.export.pieces import ExportBrokenOff
from server.export.ratings_csv import factor_names, rating_rows, view_of
from server.export.runs import run_rows
from server.models import Study

OF_THE_RUN = (
    "study", "run", "participant", "synthetic", "status", "language", "version", "started_at",
    "completed_at", "excluded", "exclusion_reason", "run_origin", "data_series", "group_name",
    "evidence_verdict",
)  # fmt: skip
"""Columns of the runs that the wide table has too, and the answers to forms with them."""
# The official Psych-DS validator stumbles at the members of its table of columns and at the number of a row.
_STUMBLES_AT = "clear constructor delete entries forEach get has keys row_id set size values"
_TAKEN = frozenset((*(column.name for column in RUN_COLUMNS), *_STUMBLES_AT.split()))
Levels = tuple[str, ...]
Means = dict[tuple[str, Levels], float]


def beside_runs(factor: str) -> str:
    """What a factor is called where columns of the runs are too: a variable has one meaning in a dataset."""
    return f"factor_{factor}" if factor in _TAKEN else factor


@dataclass(frozen=True)
class Cell:
    """A column of means: of one scale and one combination of the levels within participants."""

    scale: str
    levels: Levels
    column: Column


def cells_of(experiment: Experiment) -> list[Cell]:
    """The columns of means, scale by scale, cells in declared order."""
    scales = scales_of(experiment)
    if not scales:
        raise InputError(
            f"the wide table holds mean ratings; '{experiment.name}' has trials of the kind "
            f"{experiment.trial.kind}: take the long table (answers)"
        )
    within = [factor for factor in experiment.factors if not factor.between]
    rated = [
        [level for level in factor.levels if level.name in rated_levels(experiment, factor.name)]
        for factor in within
    ]
    cells: list[Cell] = []
    taken = {name.casefold() for name in _TAKEN}
    for scale in scales:
        for levels in product(*rated):
            name = unlike("_".join((scale.name, *(plain_name(one.name) for one in levels))), taken)
            said = ", ".join(f"{f.label}: {one.label}" for f, one in zip(within, levels, strict=True))
            column = Column(
                name, "number", _mean_of(scale, said), minimum=scale.minimum, maximum=scale.maximum
            )
            cells.append(Cell(scale.name, tuple(one.name for one in levels), column))
    return cells


def _mean_of(scale: RatedScale, cell: str) -> str:
    of = f" of {cell}" if cell else ""
    return f"Mean answer on the scale {scale.name}{of}: main trials, the last play with an answer of each."


def wide_columns(experiment: Experiment, forms: Sequence[FormColumn]) -> list[Column]:
    """The run, its groups, its answers to forms, how many answers are averaged, and a column a cell."""
    of_forms = {one.column.name for one in forms}
    kept = [one for one in run_columns(forms) if one.name in OF_THE_RUN or one.name in of_forms]
    between = [
        Column(
            beside_runs(factor.name),
            "text",
            f"Level of the factor {factor.label}, between participants.",
            values=tuple(level.name for level in factor.levels),
            labels=tuple((level.name, level.label) for level in factor.levels),
        )
        for factor in experiment.factors
        if factor.between
    ]
    number = Column("answers", "integer", "Answers of main trials that the means are of.", minimum=0)
    return [*kept, *between, number, *(cell.column for cell in cells_of(experiment))]


def wide_rows(
    session: Session,
    study: Study,
    extract: Extract,
    experiment: Experiment,
    forms: Sequence[FormColumn],
) -> Iterator[list[Any]]:
    """Rows in the order the runs began; a cell is empty where the run has no answer in it."""
    cells, names = cells_of(experiment), [column.name for column in run_columns(forms)]
    kept = [
        names.index(column.name)
        for column in wide_columns(experiment, forms)
        if column.name in names and column.name != "answers"
    ]
    between = [factor.name for factor in experiment.factors if factor.between]
    at = names.index("run")
    # Both are in the order the runs began, so that the answers of one run are in memory at a time.
    answered = _by_run(session, study, extract, experiment)
    coming = next(answered, None)
    for row in run_rows(session, study, extract, forms):
        mine = _NOTHING
        if coming is not None and coming.run == row[at]:
            mine, coming = coming, next(answered, None)
        yield [
            *(row[index] for index in kept),
            *(mine.groups.get(name, "") for name in between),
            mine.count,
            *(mine.means.get((cell.scale, cell.levels), "") for cell in cells),
        ]
    if coming is not None:
        raise ExportBrokenOff(f"the export broke off: answers of the run {coming.run} are left; try it again")


@dataclass(frozen=True)
class _RunMeans:
    """Of a run with answers: its levels between participants, how many answers, and its cells' means."""

    run: str
    groups: dict[str, str]
    count: int
    means: Means


_NOTHING = _RunMeans("", {}, 0, {})


def _by_run(session: Session, study: Study, extract: Extract, experiment: Experiment) -> Iterator[_RunMeans]:
    """The runs with rows of main trials, in the order they began."""
    factors, view = factor_names(session, study), view_of(session, study)
    header = view.csv_header(factors)
    within = [header.index(factor.name) for factor in experiment.factors if not factor.between]
    between = {factor.name: header.index(factor.name) for factor in experiment.factors if factor.between}
    run, kind, trial, scale, response = (
        header.index(name) for name in ("run", "kind", "trial_index", "scale", "response")
    )
    rows = (view.csv_row(stored, factors) for stored in rating_rows(session, study, extract))
    for name, mine in groupby((row for row in rows if row[kind] == "main"), key=itemgetter(run)):
        last: dict[tuple[Any, str], tuple[Levels, float]] = {}
        for row in mine:
            # Plays come in order: as in the scripts, a later one with an answer takes the place of an earlier
            # one of its trial; a later one without an answer leaves the earlier standing.
            if row[response] is not None:
                levels = tuple(str(row[index]) for index in within)
                last[row[trial], row[scale]] = (levels, float(row[response]))
        groups = {factor: str(row[index]) for factor, index in between.items()}
        yield _RunMeans(name, groups, len(last), _means(last))


def _means(answers: dict[tuple[Any, str], tuple[Levels, float]]) -> Means:
    values: dict[tuple[str, Levels], list[float]] = defaultdict(list)
    for (_, scale), (levels, response) in answers.items():
        values[scale, levels].append(response)
    return {cell: round(sum(each) / len(each), 6) for cell, each in values.items()}
