"""A table without what may tell who a person is, for datasets that are handed on.

Participants have pseudonyms already. Left out are answers in a person's own words and what the browser said
of itself; times are moved so that the study's first run starts with the year 2000, which keeps order and
intervals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

from server.clock import iso
from server.export.tables import ExportTable

EPOCH = datetime(2000, 1, 1, tzinfo=UTC)
MOVED = "All times of the dataset are moved alike, so that its first run starts with the year 2000."


def deidentified(table: ExportTable, first: datetime | None) -> ExportTable:
    """The table without identifying columns, its times counted from `first`."""
    kept = [index for index, column in enumerate(table.columns) if not column.identifying]
    columns = [table.columns[index] for index in kept]
    times = frozenset(index for index, column in enumerate(columns) if column.type == "time")
    described = [
        replace(column, description=f"{column.description} {MOVED}") if index in times else column
        for index, column in enumerate(columns)
    ]
    shift = EPOCH - first.astimezone(UTC) if first else timedelta()
    return replace(table, columns=described, rows=_moved(table.rows, kept, times, shift))


def _moved(
    rows: Iterator[Sequence[Any]], kept: list[int], times: frozenset[int], shift: timedelta
) -> Iterator[Sequence[Any]]:
    for row in rows:
        cells = [row[index] for index in kept]
        for index in times:
            cells[index] = _shifted(cells[index], shift)
        yield cells


def _shifted(moment: Any, shift: timedelta) -> Any:
    return iso(datetime.fromisoformat(moment) + shift) if moment else moment
