"""What every exported column means, from its declaration: as Markdown, and as schema.org variables."""

from collections.abc import Iterable
from typing import Any

from experiments.columns import RUN_COLUMNS, Column
from experiments.definition import Experiment
from experiments.trials import KINDS


def factor_columns(definitions: Iterable[Experiment]) -> list[Column]:
    """The CSV's factor columns, which stand in the place of the view's `levels`: those of all versions."""
    found: dict[str, Column] = {}
    for factor in (factor for definition in definitions for factor in definition.factors):
        before = found[factor.name].values if factor.name in found else ()
        levels = dict.fromkeys((*before, *(level.name for level in factor.levels)))
        meaning = f"Level of the factor {factor.label}."
        found[factor.name] = Column(factor.name, "text", meaning, values=tuple(levels))
    return list(found.values())


def rating_columns(definitions: Iterable[Experiment]) -> list[Column]:
    """Every column of the tidy CSV of a study with these versions, in order; the last one's kind counts."""
    versions = list(definitions)
    columns: list[Column] = []
    for column in KINDS[versions[-1].trial.kind].view.columns:
        columns.extend(factor_columns(versions) if column.name == "levels" else [column])
    return columns


def markdown(definition: Experiment, columns: Iterable[Column]) -> str:
    """The codebook as Markdown: `columns` are those of the ratings."""
    kind = KINDS[definition.trial.kind]
    lines = [
        f"# Codebook: {definition.title}",
        "",
        definition.trial.asked(definition.languages[0]),
        "",
    ]
    for title, table in (
        (kind.view.title, columns),
        ("Runs: one row a visit", RUN_COLUMNS),
    ):
        lines += [f"## {title}", "", "| column | type | unit | meaning | values |", "|---|---|---|---|---|"]
        lines += [_line(column) for column in table]
        lines.append("")
    return "\n".join(lines)


def _line(column: Column) -> str:
    cells = (column.name, column.type, column.unit or "", column.description, column.allowed)
    return f"| {' | '.join(cells)} |"


def variables_measured(columns: list[Column]) -> list[dict[str, Any]]:
    """The columns as schema.org PropertyValue objects."""
    return [_variable(column) for column in columns]


def _variable(column: Column) -> dict[str, Any]:
    found: dict[str, Any] = {
        "@type": "PropertyValue",
        "name": column.name,
        "description": column.description,
        "additionalType": column.type,
    }
    if column.unit:
        found["unitText"] = column.unit
    if column.minimum is not None:
        found["minValue"] = column.minimum
    if column.maximum is not None:
        found["maxValue"] = column.maximum
    if column.values:
        found["valueReference"] = [{"@type": "DefinedTerm", "name": value} for value in column.values]
    return found
