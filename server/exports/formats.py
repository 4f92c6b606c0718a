"""The forms in which a study's data go out, each as pieces of bytes."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from experiments.columns import Column
from experiments.columns.runs import IDENTITY_COLUMNS
from experiments.errors import InputError
from server.core.values import encode_text, now
from server.exports import psych_ds, repository, tables
from server.exports.csv_lines import check_whole, csv_pieces, rating_count, rating_pieces
from server.exports.schemas import Extract
from server.exports.tables import ExportTable, answers_table, cells_of, runs_table, wide_table
from server.models import Study
from server.studies.lookup import active_definition, all_definitions
from server.studies.series import definition_of_series
from table_files.formulas import guarded_csv

# Tables as SPSS or Parquet, written by the program `analysis`: the server carries no numerics.

LONGEST_S = 1800
AT_ONCE = 2**20
Ending = Literal["sav", "parquet"]
_COLUMNS = TypeAdapter(list[Column])


def columns_json(columns: list[Column]) -> bytes:
    """The declarations of a table's columns, as `analysis convert` reads them."""
    return _COLUMNS.dump_json(columns, indent=1)


def converted_pieces(table: ExportTable, ending: Ending) -> Iterator[bytes]:
    """The pieces of the file; InputError, with the program's own line, where it cannot be made."""
    with TemporaryDirectory(prefix="export-") as temporary:
        folder = Path(temporary)
        write_table(table, folder)
        with convert(folder, ending).open("rb") as stream:
            while piece := stream.read(AT_ONCE):
                yield piece


def write_table(table: ExportTable, folder: Path) -> None:
    """Write the table and the declarations of its columns: all that a conversion needs of the database."""
    (folder / "columns.json").write_bytes(columns_json(table.columns))
    with (folder / "table.csv").open("wb") as stream:
        for piece in csv_pieces(table.with_header()):
            stream.write(piece)


def convert(folder: Path, ending: Ending) -> Path:
    """Convert what `write_table` wrote; InputError, with the program's own line, where it cannot be."""
    target = folder / f"table.{ending}"
    program = Path(sys.executable).with_name("analysis")
    command = [str(program), "convert", str(folder / "table.csv"), "--columns", str(folder / "columns.json")]
    done = subprocess.run(  # noqa: S603 - our own program
        [*command, "--out", str(target)], capture_output=True, text=True, timeout=LONGEST_S, check=False
    )
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines()
        raise InputError(lines[-1][:500] if lines else f"analysis convert ended with code {done.returncode}")
    return target


# Recruiters' IDs with the pseudonyms: a separate export, for owners.


def identity_rows(session: Session, study: Study) -> Iterator[list[Any]]:
    """Header and one row per visit whose person is known to the recruiter, or by the label of a link."""
    yield [column.name for column in IDENTITY_COLUMNS]
    for person in repository.known_people(session, study):
        yield [
            study.name,
            person.run,
            person.participant,
            person.known_as.identifier,
            person.label if person.link_kind == "personal" else "",
            json.dumps(dict(person.known_as.parameters), sort_keys=True, ensure_ascii=False),
        ]


def check_readable(session: Session, study: Study) -> None:
    """See that every id opens before the first is given.

    Raises
    ------
    UnreadableError
        A key is under another secret key.
    """
    for _ in repository.known_people(session, study):
        pass


# The forms in which a study's data go out, each as pieces of bytes: for downloads and the command line.

Format = Literal[
    "csv", "wide", "runs", "raw", "codebook", "psych-ds", "identities",
    "spss", "spss-wide", "parquet", "parquet-wide", "columns",
]  # fmt: skip
Pieces = Callable[[Session, Study, Extract], Iterator[bytes]]


def ratings_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row per play: the columns of the codebook, one column per factor."""
    yield from rating_pieces(session, study, extract)


def runs_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row per visit, one column per form question."""
    yield from csv_pieces(runs_table(session, study, extract).with_header())


def wide_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row per visit, a column per cell of the design."""
    yield from csv_pieces(wide_table(session, study, extract).with_header())


def raw_json(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One JSON object per run and line; the last line confirms that the file is complete."""
    number = repository.run_count(session, study, extract)
    for line in check_whole(tables.raw_lines(session, study, extract), number):
        yield encode_text(line)
    yield (json.dumps({"complete": True, "runs": number}) + "\n").encode()


def codebook_markdown(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """What every column means; the same whatever the origin."""
    explained = tables.explained_tables(all_definitions(session, study), extract.old_order)
    yield encode_text(tables.codebook_text(active_definition(session, study), explained))


def psych_ds_zip(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """A Psych-DS dataset as a zip."""
    yield from psych_ds.dataset(session, study, now().date().isoformat(), extract)


def identities_csv(session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
    """One row per visit whose person is known, of any origin: the recruiter's ID and the pseudonym."""
    del extract
    rows = identity_rows(session, study)
    yield from csv_pieces(check_whole(rows, repository.known_person_count(session, study), extra=1))


@dataclass(frozen=True)
class Conversion:
    """A table that is converted as a whole, and into what."""

    table: Callable[[Session, Study, Extract], ExportTable]
    ending: Ending

    def pieces(self, session: Session, study: Study, extract: Extract) -> Iterator[bytes]:
        """The converted file."""
        return converted_pieces(self.table(session, study, extract), self.ending)


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
        cells_of(definition_of_series(session, study, extract.series))
    count = rating_count if form in ("csv", "psych-ds", "spss", "parquet") else repository.run_count
    return count(session, study, extract)
