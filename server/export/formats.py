"""The forms in which a study's data go out, each as pieces of bytes: for downloads and the command line."""

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from sqlalchemy.orm import Session

from experiments.spreadsheet import guarded_csv
from server.clock import now
from server.export import codebook, identities, psych_ds, repository, runs
from server.export.converted import Ending, columns_json, converted
from server.export.extract import Extract
from server.export.pieces import csv_pieces, rating_pieces, whole
from server.export.ratings_csv import rating_count
from server.export.tables import ExportTable, answers_table, runs_table, wide_table
from server.export.wide import cells_of
from server.models import Study
from server.studies.lookup import active_definition, all_definitions
from server.text import encoded

Format = Literal[
    "csv", "wide", "runs", "raw", "codebook", "psych-ds", "identities",
    "spss", "spss-wide", "parquet", "parquet-wide", "columns",
]  # fmt: skip
Pieces = Callable[[Session, Study, Extract], Iterator[bytes]]


def ratings_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row a play: the columns of the codebook, one column a factor."""
    yield from rating_pieces(session, study, extract)


def runs_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row a visit, a column a question of the forms."""
    yield from csv_pieces(runs_table(session, study, extract).with_header())


def wide_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row a visit, a column a cell of the design."""
    yield from csv_pieces(wide_table(session, study, extract).with_header())


def raw_json(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """Everything stored, one JSON object a run and line; the last line tells that it is complete."""
    number = repository.run_count(session, study, extract)
    for line in whole(runs.raw_lines(session, study, extract), number):
        yield encoded(line)
    yield (json.dumps({"complete": True, "runs": number}) + "\n").encode()


def codebook_markdown(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """What every column means; the same whatever the origin."""
    del extract
    tables = codebook.explained_tables(all_definitions(session, study))
    yield encoded(codebook.markdown(active_definition(session, study), tables))


def psych_ds_zip(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """A Psych-DS dataset as a zip."""
    yield from psych_ds.dataset(session, study, now().date().isoformat(), extract)


def identities_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row a visit whose person is known, of any origin: the recruiter's id beside the pseudonym."""
    del extract
    rows = identities.identity_rows(session, study)
    yield from csv_pieces(whole(rows, repository.known_person_count(session, study), extra=1))


@dataclass(frozen=True)
class Conversion:
    """A table that is converted as a whole, and into what."""

    table: Callable[[Session, Study, Extract], ExportTable]
    ending: Ending

    def pieces(self, session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
        """The converted file."""
        return converted(self.table(session, study, extract), self.ending)


CONVERSIONS: dict[Format, Conversion] = {
    "spss": Conversion(answers_table, "sav"),
    "spss-wide": Conversion(wide_table, "sav"),
    "parquet": Conversion(answers_table, "parquet"),
    "parquet-wide": Conversion(wide_table, "parquet"),
}
FORMATS: dict[Format, Pieces] = {
    "csv": ratings_csv,
    "wide": wide_csv,
    "runs": runs_csv,
    "raw": raw_json,
    "codebook": codebook_markdown,
    "psych-ds": psych_ds_zip,
    "identities": identities_csv,
    **{form: conversion.pieces for form, conversion in CONVERSIONS.items()},
    "columns": lambda *of: iter([columns_json(answers_table(*of).columns)]),
}


CSV_FORMATS: tuple[Format, ...] = ("csv", "wide", "runs", "identities")
BYTE_ORDER_MARK = "\ufeff".encode()
"""By which Excel knows UTF-8."""


def spreadsheet_pieces(
    pieces: Iterable[bytes], form: Format, bom: bool = False, guard: bool = True
) -> Iterator[bytes]:
    """The pieces of an export; of a CSV, guarded against formulas and after a byte order mark as chosen."""
    if form in CSV_FORMATS:
        pieces = guarded_csv(pieces) if guard else pieces
        if bom:
            yield BYTE_ORDER_MARK
    yield from pieces


def row_count(form: Format, session: Session, study: Study, extract: Extract) -> int:
    """Rows that a download holds, header and last line not counted: by it a client checks what it got."""
    if form == "identities":
        return repository.known_person_count(session, study)
    if form in ("wide", "spss-wide", "parquet-wide"):
        # Refuses a kind without ratings before a download begins.
        cells_of(extract.definition(session, study))
    count = rating_count if form in ("csv", "psych-ds", "spss", "parquet") else repository.run_count
    return count(session, study, extract)
