"""A study as a Psych-DS dataset (psych-ds.github.io): metadata, de-identified data and scripts."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any, Literal

from jinja2 import Environment, PackageLoader, StrictUndefined
from sqlalchemy.orm import Session

from experiments.columns import Column
from experiments.declaration.experiment import Experiment
from experiments.declaration.tables import Creator
from experiments.design import rated_levels
from experiments.kinds import KINDS, scales_of
from experiments.rules import DropFailedPlays, DropSlowTrials, ExcludeIncomplete
from server.core.values import encode_text, iso
from server.exports.csv_lines import csv_pieces, zip_pieces
from server.exports.repository import first_start
from server.exports.schemas import Extract
from server.exports.tables import (
    ExportTable,
    answers_table,
    beside_runs,
    codebook_text,
    runs_table,
    variables_measured,
    wide_table,
)
from server.models import Study
from server.studies.lookup import all_definitions, definition_of
from server.studies.series import version_of_series
from table_files.formulas import guarded_csv

# A table without anything that may identify a person, for datasets that are shared.
#
# Participants have pseudonyms already. Left out are answers in a person's own words and what the browser said
# of itself; times are moved so that the study's first run starts with the year 2000, which keeps order and
# intervals.

EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
MOVED = (
    "All times in the dataset are shifted by the same amount, so that the first run starts in the year 2000."
)


# Decision 0641: Shared datasets contain no personal data.
def deidentified_table(table: ExportTable, first: datetime | None) -> ExportTable:
    """The table without identifying columns, its times counted from `first`."""
    kept = [index for index, column in enumerate(table.columns) if not column.identifying]
    columns = [table.columns[index] for index in kept]
    times = frozenset(index for index, column in enumerate(columns) if column.type == "time")
    described = [
        replace(column, description=f"{column.description} {MOVED}") if index in times else column
        for index, column in enumerate(columns)
    ]
    shift = EPOCH - first.astimezone(UTC) if first else timedelta()
    return replace(table, columns=described, rows=_deidentified_rows(table.rows, kept, times, shift))


def _deidentified_rows(
    rows: Iterator[Sequence[Any]], kept: list[int], times: frozenset[int], shift: timedelta
) -> Iterator[Sequence[Any]]:
    for row in rows:
        cells = [row[index] for index in kept]
        for index in times:
            cells[index] = _shifted_moment(cells[index], shift)
        yield cells


def _shifted_moment(moment: Any, shift: timedelta) -> Any:
    return iso(datetime.fromisoformat(moment) + shift) if moment else moment


# Scripts that analyze an export with usual packages: R (afex, emmeans, lme4), Python (pandas, statsmodels).
#
# They are written for each study, from its declaration, and read the long table of answers.

ScriptLanguage = Literal["R", "py"]
LANGUAGES: tuple[ScriptLanguage, ...] = ("R", "py")
"""By the ending of their files. A view without its own template gets one that reads its rows."""
APPLIED = (ExcludeIncomplete, DropFailedPlays, DropSlowTrials)
"""Rules that a row's own columns decide: scripts apply them. The others look at whole runs."""


def script(
    experiment: Experiment,
    language: ScriptLanguage,
    data: str,
    names: Mapping[str, str] | None = None,
    series: int | None = None,
) -> str:
    """The script of an experiment.

    Parameters
    ----------
    data : str
        The CSV it reads by default: a path from the script's own folder.
    names : mapping of str to str, optional
        What factors are called in that CSV, where it is not their own name.
    series : int, optional
        Data series that this experiment declares; the newest if the CSV has no rows of it.
    """
    column = dict(names or {})
    factors: list[dict[str, Any]] = [
        {
            "name": column.get(factor.name, factor.name),
            "label": factor.label,
            "levels": rated_levels(experiment, factor.name),
            "between": factor.between,
            "random": factor.random,
        }
        for factor in experiment.factors
    ]
    rules = [rule.rule.replace("_", " ") for rule in experiment.exclusions if not isinstance(rule, APPLIED)]
    values: dict[str, Any] = {
        "title": " ".join(experiment.title.split()),
        "data": data,
        "factors": factors,
        "analysed": [f for f in factors if len(f["levels"]) > 1 and _in_plan(experiment, f, column)],
        "scales": scales_of(experiment),
        "applied": [rule for rule in experiment.exclusions if isinstance(rule, APPLIED)],
        "rules": rules,
        "unapplied": (
            f"note: this script does not apply these declared exclusions ({'; '.join(rules)}): "
            f"add the runs that `analysis run` reports to this script"
        ),
        "view": KINDS[experiment.trial.kind].view.name,
        "series": series,
    }
    templates = [f"{values['view']}.{language}.j2", f"answers.{language}.j2"]
    return _environment().select_template(templates).render(values)


def _in_plan(experiment: Experiment, factor: Mapping[str, Any], column: Mapping[str, str]) -> bool:
    return factor["name"] in {column.get(name, name) for name in experiment.compared_factors}


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("server", "exports/templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - scripts, whose texts are quoted by `text`
    )
    # A string of JSON is one of R and of Python too, once the escapes that only JSON has are not there.
    environment.filters["text"] = lambda value: json.dumps(str(value), ensure_ascii=False)
    environment.filters["texts"] = lambda values: ", ".join(
        json.dumps(str(value), ensure_ascii=False) for value in values
    )
    return environment


# A study as a Psych-DS dataset (psych-ds.github.io): metadata, de-identified data, codebook and scripts.

Member = tuple[str, Iterable[bytes]]


@dataclass(frozen=True)
class Folder:
    """A dataset's folder.

    Attributes
    ----------
    members : iterator of Member
        Path and bytes of each file, tables last; taken once.
    answers, runs : str
        Paths of those tables.
    renamed : dict of str to str
        Factors that have another name in this folder.
    """

    members: Iterator[Member]
    answers: str
    runs: str
    renamed: dict[str, str]


def dataset(session: Session, study: Study, made: str, extract: Extract) -> Iterator[bytes]:
    """The pieces of the zip, in which the dataset is a folder of the study's name."""
    folder = dataset_folder(session, study, made, extract)
    return zip_pieces((f"{study.name}/{path}", pieces) for path, pieces in folder.members)


def dataset_folder(session: Session, study: Study, made: str, extract: Extract) -> Folder:
    """`dataset_description.json`, README, CHANGES, `data/`, codebook, definition and scripts."""
    version = version_of_series(session, study, extract.series)
    definition, definitions = definition_of(version), all_definitions(session, study)
    factors = {factor.name for one in definitions for factor in one.factors}
    renamed = {name: beside_runs(name) for name in sorted(factors) if beside_runs(name) != name}
    first = first_start(session, study, extract)
    answers, *others = [
        deidentified_table(table, first)
        for table in _tables(session, study, extract, bool(scales_of(definition)))
    ]
    tables = [_with_renamed_columns(answers, renamed), *others]
    paths = {
        table.name: f"data/study-{_keyword(study.name)}_description-{table.name}_data.csv" for table in tables
    }
    texts = _texts(session, study, made, extract, tables)
    for language in LANGUAGES:
        texts[f"analysis/analysis.{language}"] = script(
            definition, language, f"../{paths[tables[0].name]}", renamed, version.series
        )
    members = (
        *((path, [encode_text(text)]) for path, text in texts.items()),
        *((paths[table.name], guarded_csv(csv_pieces(table.with_header()))) for table in tables),
    )
    return Folder(iter(members), paths[tables[0].name], paths["runs"], renamed)


def _tables(session: Session, study: Study, extract: Extract, wide: bool) -> list[ExportTable]:
    makers = (answers_table, runs_table, wide_table) if wide else (answers_table, runs_table)
    return [make(session, study, extract) for make in makers]


def _with_renamed_columns(table: ExportTable, renamed: dict[str, str]) -> ExportTable:
    columns = [replace(column, name=renamed.get(column.name, column.name)) for column in table.columns]
    return replace(table, columns=columns)


def _keyword(name: str) -> str:
    # Psych-DS file names are keyword-value pairs; values hold letters and digits only.
    return "".join(letter for letter in name if letter.isascii() and letter.isalnum()) or "study"


def _texts(
    session: Session, study: Study, made: str, extract: Extract, tables: list[ExportTable]
) -> dict[str, str]:
    version = version_of_series(session, study, extract.series)
    definition = definition_of(version)
    columns = [column for table in tables for column in table.columns]
    described = description(study, definition, columns, made)
    return {
        "dataset_description.json": json.dumps(described, indent=2, ensure_ascii=False),
        "README.md": _readme(study, definition, made, extract, [table.name for table in tables]),
        "CHANGES.md": f"{made} Exported from version {version.number} of the study.\n",
        "documentation/codebook.md": codebook_text(
            definition, [(_title(t, definition), t.columns) for t in tables]
        ),
        f"materials/{definition.name}.toml": version.definition_toml,
    }


def _title(table: ExportTable, definition: Experiment) -> str:
    titles = {
        "runs": "Runs: one row per visit",
        "wide": "Wide: one row per visit, one column per cell of the design",
    }
    return titles.get(table.name, KINDS[definition.trial.kind].view.title)


def description(study: Study, definition: Experiment, columns: list[Column], made: str) -> dict[str, Any]:
    """The metadata file: schema.org JSON-LD with every column of every table."""
    variables = {column.name: column for column in columns}
    technique, about = definition.trial.kind.replace("_", " "), definition.dataset
    given = KINDS[definition.trial.kind].view.name.capitalize()
    usual = f"{definition.title}. {given} of short clips collected with Palpebra."
    dataset: dict[str, Any] = {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": study.name,
        "description": about.description or usual,
        "schemaVersion": "Psych-DS 0.4.0",
        "dateModified": made,
        "citation": definition.source or "",
        "measurementTechnique": f"{technique.capitalize()} in a web browser",
        "keywords": [technique, "video clips", *(f.label for f in definition.factors), *about.keywords],
    }
    if about.creators:
        dataset["creator"] = [_creator(creator) for creator in about.creators]
    if about.licence_page:
        dataset["license"] = about.licence_page
    return dataset | {"variableMeasured": variables_measured(list(variables.values()))}


def _creator(creator: Creator) -> dict[str, Any]:
    person: dict[str, Any] = {"@type": "Person", "name": creator.name}
    if creator.orcid_page:
        person["identifier"] = creator.orcid_page
    if creator.affiliation:
        person["affiliation"] = {"@type": "Organization", "name": creator.affiliation}
    return person


def _readme(study: Study, definition: Experiment, made: str, extract: Extract, tables: list[str]) -> str:
    licence = definition.dataset.licence_page
    terms = f"Licence: {licence}." if licence else "No license is declared. Ask before you use the data."
    wide = " `data/*wide_data.csv` has one row per visit and one column per cell." if "wide" in tables else ""
    return (
        f"# {definition.title}\n\nStudy `{study.name}`, exported {made}; data of {extract}. One row per "
        f"presentation in `data/*{tables[0]}_data.csv`, one row per visit in `data/*runs_data.csv`;{wide} "
        f"every column "
        "is explained in `documentation/codebook.md`; the declared experiment is in `materials/`; scripts "
        f"for R and Python are in `analysis/`.\n\n{terms}\n\n"
        "De-identified: participants have pseudonyms, answers in their own words and browser data are "
        "removed. {MOVED} Rare combinations of answers may still identify a person: check them before you "
        "publish.\n\n"
        "Rows with `synthetic` = 1 are simulated. Rows with `excluded` = 1 were excluded by an "
        "experimenter.\n"
    )
