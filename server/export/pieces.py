"""Tables as pieces of CSV bytes, so that a download of any length takes constant memory."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

from sqlalchemy.orm import Session

from experiments.trials.clip_rating.columns import RATINGS
from server.export.ratings_csv import factor_names, rating_rows
from server.models import Study

ROWS_A_PIECE = 500


def csv_pieces(rows: Iterable[Sequence[Any]]) -> Iterator[bytes]:
    """Rows as CSV in UTF-8, some hundred rows a piece."""
    remaining = iter(rows)
    while batch := list(islice(remaining, ROWS_A_PIECE)):
        stream = io.StringIO()
        csv.writer(stream, lineterminator="\n").writerows(batch)
        yield stream.getvalue().encode("utf-8")


def rating_table(session: Session, study: Study) -> Iterator[Sequence[Any]]:
    """Header and rows of the tidy ratings CSV."""
    factors = factor_names(session, study)
    yield RATINGS.csv_header(factors)
    yield from (RATINGS.csv_row(row, factors) for row in rating_rows(session, study))
