"""Rows in a form of neither SQLite nor PostgreSQL: for copies, backups and their comparison.

Values are those of JSON; times are ISO 8601 in UTC.
"""

import hashlib
import json
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

Row = dict[str, Any]


@dataclass(frozen=True)
class Content:
    """What a table holds: number of rows, and SHA-256 over all of them in order of their key."""

    rows: int
    sha256: str


class Digest:
    """Count and hash of rows as they pass; the order of names in a JSON value does not matter."""

    def __init__(self) -> None:
        self._rows, self._hash = 0, hashlib.sha256()

    def add(self, row: Row) -> None:
        """Take in one row."""
        self._rows += 1
        self._hash.update(json.dumps(row, sort_keys=True, ensure_ascii=False).encode() + b"\n")

    def content(self) -> Content:
        """What has passed so far."""
        return Content(self._rows, self._hash.hexdigest())


def time_text(value: datetime | None) -> str | None:
    """A time as a row has it; SQLite's times have no zone and are in UTC."""
    if value is None:
        return None
    moment = value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    return moment.isoformat(timespec="microseconds")


def time_of(value: str | None, aware: bool) -> datetime | None:
    """The time behind `time_text`, with its zone where the database keeps zones."""
    if value is None:
        return None
    moment = datetime.fromisoformat(value).astimezone(UTC)
    return moment if aware else moment.replace(tzinfo=None)
