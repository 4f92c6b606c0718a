"""The forms in which a study's data go out, each as pieces of bytes: for downloads and the command line."""

from collections.abc import Callable, Iterator
from typing import Literal

from sqlalchemy.orm import Session

from server.clock import now
from server.export import codebook, psych_ds, runs
from server.export.pieces import csv_pieces, rating_table
from server.models import Study
from server.studies.lookup import active_definition, all_definitions

Format = Literal["csv", "runs", "raw", "codebook", "psych-ds"]
Pieces = Callable[[Session, Study], Iterator[bytes]]


def ratings_csv(session: Session, study: Study) -> Iterator[bytes]:
    """One row a play: the columns of the codebook, one column a factor."""
    yield from csv_pieces(rating_table(session, study))


def runs_csv(session: Session, study: Study) -> Iterator[bytes]:
    """One row a visit, forms included."""
    yield from csv_pieces(runs.run_rows(session, study))


def raw_json(session: Session, study: Study) -> Iterator[bytes]:
    """Everything stored, one JSON object a run and line."""
    for line in runs.raw_lines(session, study):
        yield line.encode("utf-8")


def codebook_markdown(session: Session, study: Study) -> Iterator[bytes]:
    """What every column means."""
    columns = codebook.rating_columns(all_definitions(session, study))
    yield codebook.markdown(active_definition(session, study), columns).encode("utf-8")


def psych_ds_zip(session: Session, study: Study) -> Iterator[bytes]:
    """A Psych-DS dataset as a zip."""
    yield from psych_ds.dataset(session, study, now().date().isoformat())


FORMATS: dict[Format, Pieces] = {
    "csv": ratings_csv,
    "runs": runs_csv,
    "raw": raw_json,
    "codebook": codebook_markdown,
    "psych-ds": psych_ds_zip,
}
