"""The tables that exports are made of: answers, runs and wide, and what every column means."""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from itertools import chain, groupby, islice, product
from operator import itemgetter
from typing import Any, Literal

from sqlalchemy.orm import Session

from experiments.columns.column import Column, in_old_order, plain_name, unlike
from experiments.columns.runs import FORMS, RUN_COLUMNS
from experiments.declaration.experiment import Experiment
from experiments.declaration.forms import Form, FormField, is_empty
from experiments.declaration.trial import RatedScale
from experiments.design import rated_levels
from experiments.errors import InputError
from experiments.kinds import KINDS, scales_of
from server.core.values import iso
from server.exports import repository
from server.exports.csv_lines import (
    ExportBrokenOff,
    check_whole,
    factor_names,
    rating_count,
    rating_rows,
    rating_table,
    view_of,
)
from server.exports.repository import run_count
from server.exports.schemas import Extract
from server.models import NO_SLOT, Study, StudyRun
from server.participation.judgement import judge_run
from server.participation.visit_repository import calibrations
from server.results import runs
from server.studies.lookup import all_definitions, definition_of
from server.studies.series import definition_of_series

# Questionnaire answers as columns: one per question, or one per option if several may be chosen.

PREFIX = "form_"
"""No other column begins like this, and no factor name can be mistaken for one."""


@dataclass(frozen=True)
class FormColumn:
    """A column and its answer: that of a form field, or of one option if several may be chosen."""

    column: Column
    form: str
    field: str
    option: str | None = None

    def value(self, answers: Mapping[str, Mapping[str, Any]]) -> Any:
        """The cell value from a run's answers by form and field; empty if there is no answer."""
        answer = answers.get(self.form, {}).get(self.field)
        if is_empty(answer):
            return ""
        if self.option is not None:
            return int(isinstance(answer, list) and self.option in answer)
        return "; ".join(map(str, answer)) if isinstance(answer, list) else answer


def form_columns(definitions: Iterable[Experiment]) -> list[FormColumn]:
    """The columns of all versions' forms, in order; later versions of a question override earlier ones."""
    known: dict[tuple[str, str, str | None], FormColumn] = {}
    for experiment in definitions:
        language = experiment.languages[0]
        for form in experiment.forms:
            for field in form.fields:
                for column in _of_field(form, field, language):
                    key = (column.form, column.field, column.option)
                    known[key] = _united(known.get(key), column)
    return list(_named(known.values()))


def run_columns(forms: Iterable[FormColumn], old_order: bool = False) -> list[Column]:
    """The columns of the runs CSV of a study with these questions, which replace `FORMS`."""
    columns: list[Column] = []
    for column in in_old_order("runs", RUN_COLUMNS) if old_order else RUN_COLUMNS:
        columns.extend([one.column for one in forms] if column is FORMS else [column])
    return columns


def _of_field(form: Form, field: FormField, language: str) -> Iterator[FormColumn]:
    asked = field.label.get(language) or next(iter(field.label.values()))
    for option, column in field.columns(f"{PREFIX}{form.name}_{field.name}", asked, language).items():
        yield FormColumn(column, form.name, field.name, option)


def _united(before: FormColumn | None, after: FormColumn) -> FormColumn:
    """The later column, plus options that only earlier versions had."""
    if before is None or not before.column.values:
        return after
    values = tuple(dict.fromkeys((*before.column.values, *after.column.values)))
    labels = tuple({**dict(before.column.labels), **dict(after.column.labels)}.items())
    return replace(after, column=replace(after.column, values=values, labels=labels))


def _named(columns: Iterable[FormColumn]) -> Iterator[FormColumn]:
    """The columns with unique names (`a_b` with `c` is spelled like `a` with `b_c`)."""
    taken: set[str] = set()
    for one in columns:
        yield replace(one, column=replace(one.column, name=unlike(one.column.name, taken)))


# Runs as CSV rows, and everything stored as JSON lines; one run is in memory at a time.


def run_rows(
    session: Session, study: Study, extract: Extract, forms: Sequence[FormColumn]
) -> Iterator[list[Any]]:
    """Rows of the runs CSV in the order the runs began: the columns of `run_columns(forms)`."""
    names = [column.name for column in run_columns(forms, extract.old_order)]
    name = study.name
    for run in repository.each_run(session, study, extract):
        values = _values(session, run, forms) | {"study": name}
        yield [values[column] for column in names]


def _values(session: Session, run: StudyRun, forms: Sequence[FormColumn]) -> dict[str, Any]:
    answers = repository.answers_by_form(session, run)
    return {
        "run": run.public_id,
        "participant": run.participant,
        "phase": run.phase,
        "synthetic": int(run.origin == "simulated"),
        "status": run.status,
        "stage": run.stage,
        "language": run.language,
        "version": run.version.number,
        "definition_sha256": run.version.definition_sha256,
        "seed": run.seed,
        "slot": run.slot if run.slot != NO_SLOT else "",
        "group_name": run.group_name,
        "started_at": _time(run.started_at),
        "consented_at": _time(run.consented_at),
        "completed_at": _time(run.completed_at),
        "trials": run.trials_total,
        "excluded": int(run.excluded),
        "exclusion_reason": run.exclusion_reason or "",
        "erased": int(run.erased_at is not None),
        **{one.column.name: one.value(answers) for one in forms},
        "device": _json(run.device),
        "run_origin": run.origin,
        "data_series": run.version.series,
        **_calibration(session, run),
    } | _evidence(session, run)


def _calibration(session: Session, run: StudyRun) -> dict[str, Any]:
    """How the latest size and distance were measured; nothing if none were, or by an earlier page."""
    every = calibrations(session, run)
    rechecks = [one.recheck_percent for one in every if one.recheck_percent is not None]
    latest = every[-1] if every else None
    values = {
        "calibration_method": latest and latest.method,
        "calibration_repeats": latest and latest.repeats,
        "calibration_spread": latest and latest.spread_percent,
        "calibration_ruler": latest and latest.ruler_check,
        "calibration_recheck": max(rechecks, default=None),
        "distance_method": latest and latest.distance_method,
        "distance_spread_mm": latest and latest.distance_spread_mm,
        "distance_typed_mm": latest and latest.distance_typed_mm,
    }
    return {name: "" if value is None else value for name, value in values.items()}


def _evidence(session: Session, run: StudyRun) -> dict[str, Any]:
    judged = judge_run(session, run)
    values = {f"evidence_{name}": _rounded_cell(value) for name, value in asdict(judged.signals).items()}
    points = "" if judged.verdict == "not_judged" else judged.points
    return values | {"evidence_verdict": judged.verdict, "evidence_points": points}


def _rounded_cell(value: float | None) -> float | str:
    return "" if value is None else round(value, 4)


def _time(moment: datetime | None) -> str:
    return iso(moment) if moment else ""


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)


def raw_lines(session: Session, study: Study, extract: Extract) -> Iterator[str]:
    """One JSON object per run with every play, drawn frame, event, form and calibration."""
    for public_id in repository.public_ids(session, study, extract):
        yield runs.timeline(session, study, public_id).model_dump_json() + "\n"


# The wide table: one row per run, and a column per cell of the design with the run's mean rating in it.

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
FactorLevels = frozenset[tuple[str, str]]
"""Factors and their levels: versions with other factors, or in another order, have other cells."""
Means = dict[tuple[str, FactorLevels], float]


def beside_runs(factor: str) -> str:
    """What a factor is called where columns of the runs are too: a variable has one meaning in a dataset."""
    return f"factor_{factor}" if factor in _TAKEN else factor


@dataclass(frozen=True)
class Cell:
    """A column of means: of one scale and one combination of the levels within participants."""

    scale: str
    levels: Levels
    column: Column
    factor_levels: FactorLevels


def cells_of(
    experiment: Experiment, earlier: Sequence[Experiment] = (), every: Sequence[Experiment] = ()
) -> list[Cell]:
    """The columns of means, scale by scale, cells in declared order; then those of earlier versions alone.

    A cell of several versions has one column, whose range is that of all their scales.

    Parameters
    ----------
    every : sequence of Experiment, optional
        All versions of the study, newest first: by them each cell has the same name in every extract.
    """
    versions = (experiment, *earlier)
    # By identity: `definition_of` gives one object per declaration, which cannot be hashed.
    of_version = {
        id(version): _cells(version)
        for version in {id(one): one for one in (*versions, *every)}.values()
        if version is experiment or scales_of(version)
    }
    names: dict[tuple[str, FactorLevels], str] = {}
    taken = {name.casefold() for name in _TAKEN}
    for version in every or versions:
        for cell in of_version.get(id(version), ()):
            key = (cell.scale, cell.factor_levels)
            if key not in names:
                names[key] = unlike(cell.column.name, taken)
    cells: dict[tuple[str, FactorLevels], Cell] = {}
    for version in versions:
        for cell in of_version.get(id(version), ()):
            key = (cell.scale, cell.factor_levels)
            known = cells.setdefault(key, replace(cell, column=replace(cell.column, name=names[key])))
            cells[key] = replace(known, column=_of_both(known.column, cell.column))
    return list(cells.values())


def _of_both(one: Column, other: Column) -> Column:
    """The column with a range that holds the answers of both; scales have both ends."""
    low, high = ([getattr(each, end) for each in (one, other)] for end in ("minimum", "maximum"))
    return replace(one, minimum=min(low), maximum=max(high))


def _cells(experiment: Experiment) -> list[Cell]:
    """The cells of one version; names of their columns may collide."""
    scales = scales_of(experiment)
    if not scales:
        raise InputError(
            f"the wide table contains mean ratings, but '{experiment.name}' has trials of the kind "
            f"{experiment.trial.kind}; use the long table (answers)"
        )
    within = [factor for factor in experiment.factors if not factor.between]
    rated = [
        [level for level in factor.levels if level.name in rated_levels(experiment, factor.name)]
        for factor in within
    ]
    cells: list[Cell] = []
    for scale in scales:
        for levels in product(*rated):
            name = "_".join((scale.name, *(plain_name(one.name) for one in levels)))
            said = ", ".join(f"{f.label}: {one.label}" for f, one in zip(within, levels, strict=True))
            column = Column(
                name, "number", _mean_of(scale, said), minimum=scale.minimum, maximum=scale.maximum
            )
            factor_levels = frozenset((f.name, one.name) for f, one in zip(within, levels, strict=True))
            cells.append(Cell(scale.name, tuple(one.name for one in levels), column, factor_levels))
    return cells


def _mean_of(scale: RatedScale, cell: str) -> str:
    of = f" of {cell}" if cell else ""
    return f"Mean answer on the scale {scale.name}{of}: main trials, the last answered presentation of each."


def wide_columns(
    experiment: Experiment,
    forms: Sequence[FormColumn],
    old_order: bool = False,
    earlier: Sequence[Experiment] = (),
    every: Sequence[Experiment] = (),
) -> list[Column]:
    """The run, its groups, its answers to forms, how many answers are averaged, and a column per cell."""
    between = [
        Column(
            beside_runs(factor.name),
            "text",
            f"Level of the between-participant factor {factor.label}.",
            values=tuple(level.name for level in factor.levels),
            labels=tuple((level.name, level.label) for level in factor.levels),
        )
        for factor in experiment.factors
        if factor.between
    ]
    number = Column(
        "answers", "integer", "Number of answers in main trials that the means are based on.", minimum=0
    )
    return [
        *_kept(forms, old_order),
        *between,
        number,
        *(cell.column for cell in cells_of(experiment, earlier, every)),
    ]


def _kept(forms: Sequence[FormColumn], old_order: bool) -> list[Column]:
    """The columns of the runs that the wide table has too."""
    of_forms = {one.column.name for one in forms}
    return [one for one in run_columns(forms, old_order) if one.name in OF_THE_RUN or one.name in of_forms]


def wide_rows(
    session: Session,
    study: Study,
    extract: Extract,
    experiment: Experiment,
    forms: Sequence[FormColumn],
    earlier: Sequence[Experiment] = (),
) -> Iterator[list[Any]]:
    """Rows in the order the runs began; a cell is empty where the run has no answer in it."""
    cells = cells_of(experiment, earlier)
    names = [column.name for column in run_columns(forms, extract.old_order)]
    kept = [names.index(column.name) for column in _kept(forms, extract.old_order)]
    between = [factor.name for factor in experiment.factors if factor.between]
    at = names.index("run")
    # Both are in the order the runs began, so that the answers of one run are in memory at a time.
    answered = _by_run(session, study, extract, [experiment, *earlier])
    coming = next(answered, None)
    for row in run_rows(session, study, extract, forms):
        mine = _NOTHING
        if coming is not None and coming.run == row[at]:
            mine, coming = coming, next(answered, None)
        yield [
            *(row[index] for index in kept),
            *(mine.groups.get(name, "") for name in between),
            mine.count,
            *(mine.means.get((cell.scale, cell.factor_levels), "") for cell in cells),
        ]
    if coming is not None:
        raise ExportBrokenOff(f"the export failed: answers of the run {coming.run} remain; try again")


@dataclass(frozen=True)
class _RunMeans:
    """A run with answers: its levels between participants, number of answers, and its cells' means."""

    run: str
    groups: dict[str, str]
    count: int
    means: Means


_NOTHING = _RunMeans("", {}, 0, {})


def _by_run(
    session: Session, study: Study, extract: Extract, experiments: Sequence[Experiment]
) -> Iterator[_RunMeans]:
    """The runs with rows of main trials, in the order they began; the first declaration has the groups."""
    factors, view = factor_names(session, study), view_of(session, study, extract)
    header = view.csv_header(factors)
    groups = {factor.name: header.index(factor.name) for factor in experiments[0].factors if factor.between}
    of_cells = {factor.name for one in experiments for factor in one.factors if not factor.between}
    within = {name: header.index(name) for name in of_cells}
    # A factor may be between participants in one version and within them in another.
    between = {
        version.number: {factor.name for factor in definition_of(version).factors if factor.between}
        for version in repository.answered_versions(session, study, extract)
    }
    run, kind, trial, scale, response, version_at = (
        header.index(name) for name in ("run", "kind", "trial_index", "scale", "response", "study_version")
    )
    rows = (view.csv_row(stored, factors) for stored in rating_rows(session, study, extract))
    for name, mine in groupby((row for row in rows if row[kind] == "main"), key=itemgetter(run)):
        last: dict[tuple[Any, str], tuple[FactorLevels, float]] = {}
        for row in mine:
            # Plays come in order: as in the scripts, a later one with an answer takes the place of an earlier
            # one of its trial; a later one without an answer leaves the earlier standing.
            if row[response] is not None:
                # Factors of other versions are empty.
                levels = (
                    (factor, row[index])
                    for factor, index in within.items()
                    if factor not in between[row[version_at]]
                )
                factor_levels = frozenset(
                    (factor, str(level)) for factor, level in levels if level not in (None, "")
                )
                last[row[trial], row[scale]] = (factor_levels, float(row[response]))
        # All rows of a run are of one version.
        mine_between = between[row[version_at]]
        of_run = {factor: str(row[index]) for factor, index in groups.items() if factor in mine_between}
        yield _RunMeans(name, of_run, len(last), _means(last))


def _means(answers: dict[tuple[Any, str], tuple[FactorLevels, float]]) -> Means:
    values: dict[tuple[str, FactorLevels], list[float]] = defaultdict(list)
    for (_, scale), (factor_levels, response) in answers.items():
        values[scale, factor_levels].append(response)
    return {cell: round(sum(each) / len(each), 6) for cell, each in values.items()}


# What every exported column means, from its declaration: as Markdown, and as schema.org variables.


def factor_columns(definitions: Iterable[Experiment]) -> list[Column]:
    """The CSV's factor columns, which replace the view's `levels`: those of all versions."""
    columns: dict[str, Column] = {}
    for factor in (factor for definition in definitions for factor in definition.factors):
        before = dict(columns[factor.name].labels) if factor.name in columns else {}
        labels = {**before, **{level.name: level.label for level in factor.levels}}
        meaning = f"Level of the factor {factor.label}."
        columns[factor.name] = Column(
            factor.name, "text", meaning, values=tuple(labels), labels=tuple(labels.items())
        )
    return list(columns.values())


def rating_columns(definitions: Iterable[Experiment], old_order: bool = False) -> list[Column]:
    """Every column of the tidy CSV of a study with these versions, in order; the last one's kind counts."""
    versions = list(definitions)
    columns: list[Column] = []
    view = KINDS[versions[-1].trial.kind].view
    for column in (view.in_old_order() if old_order else view).columns:
        columns.extend(factor_columns(versions) if column.name == "levels" else [column])
    return columns


def codebook_text(definition: Experiment, tables: Iterable[tuple[str, Iterable[Column]]]) -> str:
    """The codebook as Markdown: of each table its title and its columns."""
    lines = [
        f"# Codebook: {definition.title}",
        "",
        definition.trial.asked(definition.languages[0]),
        "",
    ]
    for title, table in tables:
        lines += [f"## {title}", "", "| column | type | unit | meaning | values |", "|---|---|---|---|---|"]
        lines += [_line(column) for column in table]
        lines.append("")
    return "\n".join(lines)


def explained_tables(
    definitions: list[Experiment], old_order: bool = False
) -> list[tuple[str, list[Column]]]:
    """The tables of a study with these versions by title: answers, runs, and wide where it has one."""
    active, forms = definitions[-1], form_columns(definitions)
    tables = [
        (KINDS[active.trial.kind].view.title, rating_columns(definitions, old_order)),
        ("Runs: one row per visit", run_columns(forms, old_order)),
    ]
    if scales_of(active):
        every = wide_columns(active, forms, old_order, definitions[-2::-1])
        cells = [column for column in every if column not in tables[1][1]]
        title = "Wide: one row per visit; the columns of the runs, plus one column per cell of the design"
        tables.append((title, cells))
    return tables


def _line(column: Column) -> str:
    cells = (column.name, column.type, column.unit or "", column.description, column.allowed)
    return f"| {' | '.join(cell.replace('|', '&#124;').replace(chr(10), ' ') for cell in cells)} |"


def variables_measured(columns: list[Column]) -> list[dict[str, Any]]:
    """The columns as schema.org PropertyValue objects."""
    return [_variable(column) for column in columns]


def _variable(column: Column) -> dict[str, Any]:
    variable: dict[str, Any] = {
        "@type": "PropertyValue",
        "name": column.name,
        "description": column.description,
        "additionalType": column.type,
    }
    if column.unit:
        variable["unitText"] = column.unit
    if column.minimum is not None:
        variable["minValue"] = column.minimum
    if column.maximum is not None:
        variable["maxValue"] = column.maximum
    if column.values:
        variable["valueReference"] = [_term(value, dict(column.labels)) for value in column.values]
    return variable


def _term(value: str, labels: dict[str, str]) -> dict[str, str]:
    term = {"@type": "DefinedTerm", "name": value}
    return term | {"description": labels[value]} if labels.get(value, value) != value else term


# The tables that exports are made of: answers (one row per play), runs (one row per visit), wide (one row per
# run).

TableName = Literal["answers", "runs", "wide"]
Row = Sequence[Any]


@dataclass(frozen=True)
class ExportTable:
    """A table on its way out.

    Attributes
    ----------
    name : str
        As files are called by it.
    columns : list of Column
        In order.
    rows : iterator of Row
        Without a header; taken once.
    count : int
        Of the rows, which `rows` is held to.
    """

    name: str
    columns: list[Column]
    rows: Iterator[Row]
    count: int

    def with_header(self) -> Iterator[Row]:
        """The names of the columns, then the rows."""
        return chain([[column.name for column in self.columns]], self.rows)


def answers_table(session: Session, study: Study, extract: Extract) -> ExportTable:
    """One row per play (or a scale and play), a column per factor."""
    columns = rating_columns(all_definitions(session, study), extract.old_order)
    rows = islice(rating_table(session, study, extract), 1, None)
    name = view_of(session, study, extract).name
    return ExportTable(name, columns, rows, rating_count(session, study, extract))


def runs_table(session: Session, study: Study, extract: Extract) -> ExportTable:
    """One row per visit, one column per form question."""
    forms, number = form_columns(all_definitions(session, study)), run_count(session, study, extract)
    rows = check_whole(run_rows(session, study, extract, forms), number)
    return ExportTable("runs", run_columns(forms, extract.old_order), rows, number)


def wide_table(session: Session, study: Study, extract: Extract) -> ExportTable:
    """One row per visit, a column per cell with its mean rating; InputError for trials without a scale."""
    definitions, number = all_definitions(session, study), run_count(session, study, extract)
    newest, forms = definition_of_series(session, study, extract.series), form_columns(definitions)
    # Answers of another data series may lie in cells that the newest declaration no longer has.
    earlier = [definition_of(version) for version in repository.answered_versions(session, study, extract)]
    rows = check_whole(wide_rows(session, study, extract, newest, forms, earlier), number)
    columns = wide_columns(newest, forms, extract.old_order, earlier, definitions[::-1])
    return ExportTable("wide", columns, rows, number)


TABLES: dict[TableName, Callable[[Session, Study, Extract], ExportTable]] = {
    "answers": answers_table,
    "runs": runs_table,
    "wide": wide_table,
}
