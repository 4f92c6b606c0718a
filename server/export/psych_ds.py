"""A study as a Psych-DS dataset (psych-ds.github.io): metadata, de-identified data, codebook and scripts."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy.orm import Session

from experiments.columns import Column
from experiments.definition import Experiment
from experiments.definition.dataset import Creator
from experiments.spreadsheet import guarded_csv
from experiments.trials import KINDS
from experiments.trials.scales import scales_of
from server.export.codebook import markdown, variables_measured
from server.export.deidentified import MOVED, deidentified
from server.export.extract import Extract
from server.export.pieces import csv_pieces
from server.export.repository import first_start
from server.export.scripts import LANGUAGES, script
from server.export.tables import ExportTable, answers_table, runs_table, wide_table
from server.export.wide import beside_runs
from server.export.zip_stream import zip_pieces
from server.models import Study
from server.studies.lookup import all_definitions, definition_of
from server.studies.series import version_of_series
from server.text import encoded

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
    definition, definitions = extract.definition(session, study), all_definitions(session, study)
    factors = {factor.name for one in definitions for factor in one.factors}
    renamed = {name: beside_runs(name) for name in sorted(factors) if beside_runs(name) != name}
    first = first_start(session, study, extract)
    answers, *others = [
        deidentified(table, first) for table in _tables(session, study, extract, bool(scales_of(definition)))
    ]
    tables = [_renamed(answers, renamed), *others]
    paths = {
        table.name: f"data/study-{_keyword(study.name)}_description-{table.name}_data.csv" for table in tables
    }
    texts = _texts(session, study, made, extract, tables)
    for language in LANGUAGES:
        texts[f"analysis/analysis.{language}"] = script(
            definition, language, f"../{paths[tables[0].name]}", renamed
        )
    members = (
        *((path, [encoded(text)]) for path, text in texts.items()),
        *((paths[table.name], guarded_csv(csv_pieces(table.with_header()))) for table in tables),
    )
    return Folder(iter(members), paths[tables[0].name], paths["runs"], renamed)


def _tables(session: Session, study: Study, extract: Extract, wide: bool) -> list[ExportTable]:
    makers = (answers_table, runs_table, wide_table) if wide else (answers_table, runs_table)
    return [make(session, study, extract) for make in makers]


def _renamed(table: ExportTable, renamed: dict[str, str]) -> ExportTable:
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
        "documentation/codebook.md": markdown(
            definition, [(_title(t, definition), t.columns) for t in tables]
        ),
        f"materials/{definition.name}.toml": version.definition_toml,
    }


def _title(table: ExportTable, definition: Experiment) -> str:
    titles = {
        "runs": "Runs: one row a visit",
        "wide": "Wide: one row a visit, a column a cell of the design",
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
    terms = f"Licence: {licence}." if licence else "No licence is declared: ask before you use the data."
    wide = " `data/*wide_data.csv` has one row a visit and a column a cell." if "wide" in tables else ""
    return (
        f"# {definition.title}\n\nStudy `{study.name}`, exported {made}; data of {extract}. One row a "
        f"play in `data/*{tables[0]}_data.csv`, one row a visit in `data/*runs_data.csv`;{wide} every column "
        "is explained in `documentation/codebook.md`; the declared experiment is in `materials/`; scripts "
        f"for R and Python are in `analysis/`.\n\n{terms}\n\n"
        "De-identified: participants have pseudonyms, answers in their own words and what their browsers "
        f"said are left out. {MOVED} Rare combinations of answers may still point to a person: look at them "
        "before you publish.\n\n"
        "Rows with `synthetic` = 1 were not given by people. Rows with `excluded` = 1 were excluded by an "
        "experimenter.\n"
    )
