"""A study as a Psych-DS dataset (psych-ds.github.io): a zip with metadata, data and codebook, streamed."""

import io
import json
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from sqlalchemy.orm import Session

from experiments.columns import RUN_COLUMNS, Column
from experiments.definition import Experiment
from experiments.trials import KINDS
from server.export.codebook import (
    factor_columns,
    markdown,
    rating_columns,
    variables_measured,
)
from server.export.origins import ExportOrigin
from server.export.pieces import csv_pieces, rating_table, whole
from server.export.runs import run_count, run_rows
from server.models import Study
from server.studies.lookup import active_definition, active_version, all_definitions
from server.text import encoded


class _Sink(io.RawIOBase):
    """What the zip writer writes to; `take` hands on what has come since."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """True: this stream only takes."""
        return True

    def write(self, piece: Any) -> int:
        """Keep a piece until it is taken."""
        self._pieces.append(bytes(piece))
        return len(piece)

    def take(self) -> bytes:
        """Everything written since the last call."""
        taken = b"".join(self._pieces)
        self._pieces.clear()
        return taken


# What factors cannot be called here: a variable has one meaning in the whole folder, so no
# column of the runs; and the official validator stumbles at the members of its table of columns and at
# the number it gives each row.
_STUMBLES_AT = "clear constructor delete entries forEach get has keys row_id set size values"
_TAKEN = frozenset((*(column.name for column in RUN_COLUMNS), *_STUMBLES_AT.split()))


def _own_name(column: str) -> str:
    return f"factor_{column}" if column in _TAKEN else column


def dataset(session: Session, study: Study, made: str, origin: ExportOrigin) -> Iterator[bytes]:
    """The pieces of the zip: `dataset_description.json`, README, CHANGES, `data/`, codebook, definition."""
    sink = _Sink()
    version, definition = active_version(session, study), active_definition(session, study)
    columns = _columns(all_definitions(session, study))
    keyword, view = _keyword(study.name), KINDS[definition.trial.kind].view
    texts = {
        "dataset_description.json": json.dumps(
            description(study, definition, columns, made), indent=2, ensure_ascii=False
        ),
        "README.md": _readme(study, definition, made, origin, view.name),
        "CHANGES.md": f"{made} Exported from version {version.number} of the study.\n",
        "documentation/codebook.md": markdown(definition, columns),
        f"materials/{definition.name}.toml": version.definition_toml,
    }
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in texts.items():
            archive.writestr(f"{study.name}/{name}", encoded(text))
            yield sink.take()
        tables: tuple[tuple[str, Iterable[Sequence[Any]]], ...] = (
            (view.name, _with_header(columns, rating_table(session, study, origin))),
            ("runs", whole(run_rows(session, study, origin), run_count(session, study, origin), extra=1)),
        )
        for table, rows in tables:
            path = f"{study.name}/data/study-{keyword}_description-{table}_data.csv"
            with archive.open(path, "w", force_zip64=True) as member:
                for piece in csv_pieces(rows):
                    member.write(piece)
                    yield sink.take()
            yield sink.take()
    yield sink.take()


def _columns(definitions: list[Experiment]) -> list[Column]:
    """Columns of the ratings, under the names that they have in this folder."""
    factors = {column.name for column in factor_columns(definitions)}
    return [
        replace(column, name=_own_name(column.name)) if column.name in factors else column
        for column in rating_columns(definitions)
    ]


def _with_header(columns: list[Column], rows: Iterator[Sequence[Any]]) -> Iterator[Sequence[Any]]:
    next(rows)
    yield [column.name for column in columns]
    yield from rows


def _keyword(name: str) -> str:
    # Psych-DS file names are keyword-value pairs; values hold letters and digits only.
    return "".join(letter for letter in name if letter.isascii() and letter.isalnum()) or "study"


def description(study: Study, definition: Experiment, columns: list[Column], made: str) -> dict[str, Any]:
    """The metadata file: schema.org JSON-LD with every column of every table."""
    variables = {column.name: column for column in (*columns, *RUN_COLUMNS)}
    technique = definition.trial.kind.replace("_", " ")
    given = KINDS[definition.trial.kind].view.name.capitalize()
    return {
        "@context": "https://schema.org/",
        "@type": "Dataset",
        "name": study.name,
        "description": f"{definition.title}. {given} of short clips collected with Palpebra.",
        "schemaVersion": "Psych-DS 0.4.0",
        "dateModified": made,
        "citation": definition.source or "",
        "measurementTechnique": f"{technique.capitalize()} in a web browser",
        "keywords": [
            technique,
            "video clips",
            *(factor.label for factor in definition.factors),
        ],
        "variableMeasured": variables_measured(list(variables.values())),
    }


def _readme(study: Study, definition: Experiment, made: str, origin: ExportOrigin, table: str) -> str:
    whose = "all origins, told apart by `run_origin`" if origin == "all" else f"the origin `{origin}` alone"
    return (
        f"# {definition.title}\n\nStudy `{study.name}`, exported {made}; data of {whose}. One row a play in "
        f"`data/*{table}_data.csv`, one row a visit in `data/*runs_data.csv`; every column is explained in "
        "`documentation/codebook.md`; the declared experiment is in `materials/`.\n\n"
        "Rows with `synthetic` = 1 were not given by people. Rows with `excluded` = 1 were excluded by an "
        "experimenter, with the reason beside them.\n"
    )
