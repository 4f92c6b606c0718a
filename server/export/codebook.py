"""What every exported column means, from its declaration: as Markdown, and as schema.org variables."""

from collections.abc import Iterable
from typing import Any

from experiments.definition import Experiment
from experiments.ratings import RATING_COLUMNS, Column

RUN_COLUMNS: tuple[Column, ...] = (
    Column("study", "text", "Name of the study, unique on this server."),
    Column("run", "text", "Public identifier of the participant's visit (study run)."),
    Column("participant", "text", "Identifier of the participant: link label, recruiter's id, or the run's."),
    Column("phase", "text", "Whether the study was a pilot or live.", values=("pilot", "live")),
    Column("synthetic", "boolean", "True where no person took part: simulated data."),
    Column("status", "text", "State of the visit."),
    Column("stage", "text", "How far the visit came."),
    Column("language", "text", "Language the participant read."),
    Column("version", "integer", "Version of the study the run was made with."),
    Column("definition_sha256", "text", "SHA-256 of that version's declaration."),
    Column("seed", "integer", "Seed of the trial order."),
    Column("slot", "integer", "Place in the counterbalancing."),
    Column("started_at", "time", "Start of the visit (UTC, ISO 8601)."),
    Column("consented_at", "time", "When the participant agreed (UTC, ISO 8601)."),
    Column("completed_at", "time", "End of a complete visit (UTC, ISO 8601)."),
    Column("trials", "integer", "Trials of the run, practice and checks included."),
    Column("excluded", "boolean", "True where an experimenter excluded the run by hand."),
    Column("exclusion_reason", "text", "Why an experimenter excluded the run."),
    Column("erased", "boolean", "True where the person's data were erased on request."),
    Column("forms", "text", "JSON object of form names and their answers."),
    Column("device", "text", "JSON object of what the browser said of itself."),
    Column("recruiter_parameters", "text", "JSON object of the parameters of the recruiter's address."),
)


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
    """Every column of the ratings CSV of a study with these versions, in order."""
    columns: list[Column] = []
    for column in RATING_COLUMNS:
        columns.extend(factor_columns(definitions) if column.name == "levels" else [column])
    return columns


def markdown(definition: Experiment, columns: Iterable[Column]) -> str:
    """The codebook as Markdown: `columns` are those of the ratings."""
    scale = definition.trial.scale
    language = definition.languages[0]
    lines = [
        f"# Codebook: {definition.title}",
        "",
        f"Scale: {scale.minimum} ({scale.low.get(language, '')}) to {scale.maximum} "
        f"({scale.high.get(language, '')}). Question: {scale.question.get(language, '')}",
        "",
    ]
    for title, table in (
        ("Ratings: one row a play", columns),
        ("Runs: one row a visit", RUN_COLUMNS),
    ):
        lines += [f"## {title}", "", "| column | type | unit | meaning | values |", "|---|---|---|---|---|"]
        lines += [_line(column) for column in table]
        lines.append("")
    return "\n".join(lines)


def _line(column: Column) -> str:
    values = ", ".join(column.values)
    return f"| {column.name} | {column.type} | {column.unit or ''} | {column.sentence} | {values} |"


def variables_measured(columns: list[Column]) -> list[dict[str, Any]]:
    """The columns as schema.org PropertyValue objects."""
    return [_variable(column) for column in columns]


def _variable(column: Column) -> dict[str, Any]:
    found: dict[str, Any] = {
        "@type": "PropertyValue",
        "name": column.name,
        "description": column.sentence,
        "additionalType": column.type,
    }
    if column.unit:
        found["unitText"] = column.unit
    if column.values:
        found["valueReference"] = [{"@type": "DefinedTerm", "name": value} for value in column.values]
    return found
