"""What every exported column means, from its declaration: as Markdown, and as schema.org variables."""

from collections.abc import Iterable
from typing import Any

from experiments.columns import Column
from experiments.columns.form_columns import form_columns, run_columns
from experiments.definition import Experiment
from experiments.trials import KINDS
from experiments.trials.scales import scales_of
from server.export.wide import wide_columns


def factor_columns(definitions: Iterable[Experiment]) -> list[Column]:
    """The CSV's factor columns, which stand in the place of the view's `levels`: those of all versions."""
    columns: dict[str, Column] = {}
    for factor in (factor for definition in definitions for factor in definition.factors):
        before = dict(columns[factor.name].labels) if factor.name in columns else {}
        labels = {**before, **{level.name: level.label for level in factor.levels}}
        meaning = f"Level of the factor {factor.label}."
        columns[factor.name] = Column(
            factor.name, "text", meaning, values=tuple(labels), labels=tuple(labels.items())
        )
    return list(columns.values())


def rating_columns(definitions: Iterable[Experiment]) -> list[Column]:
    """Every column of the tidy CSV of a study with these versions, in order; the last one's kind counts."""
    versions = list(definitions)
    columns: list[Column] = []
    for column in KINDS[versions[-1].trial.kind].view.columns:
        columns.extend(factor_columns(versions) if column.name == "levels" else [column])
    return columns


def markdown(definition: Experiment, tables: Iterable[tuple[str, Iterable[Column]]]) -> str:
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


def explained_tables(definitions: list[Experiment]) -> list[tuple[str, list[Column]]]:
    """The tables of a study with these versions by title: answers, runs, and wide where it has one."""
    active, forms = definitions[-1], form_columns(definitions)
    tables = [
        (KINDS[active.trial.kind].view.title, rating_columns(definitions)),
        ("Runs: one row a visit", run_columns(forms)),
    ]
    if scales_of(active):
        cells = [column for column in wide_columns(active, forms) if column not in tables[1][1]]
        title = "Wide: one row a visit; beside columns of the runs, a column a cell of the design"
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
