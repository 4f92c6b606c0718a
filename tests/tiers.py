"""Which tests `make test` leaves to `make test-all`: those that `tests/tiers.toml` names, and three kinds.

All others are in both (decision 0980). `tests/conftest.py` marks the long ones; no test sets the mark itself.
"""

import tomllib
from collections.abc import Collection
from functools import cache
from pathlib import Path

SHORT_RUN = "not long"
"""What `make test` gives pytest with `-m`."""

_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
LONG: dict[str, str] = {test: group["reason"] for group in _TABLE["long"] for test in group["tests"]}
"""A folder (it ends in a slash), a file or a test (`file::test`): why it is long."""
POSTGRES: frozenset[str] = frozenset(_TABLE["postgres"])
"""Files whose tests on PostgreSQL are not long."""
REAL_RECORDINGS = "shared_data"
"""Fixture of the folder next to the checkout, which no clone has."""


def is_long(name: str, markers: Collection[str], fixtures: Collection[str] = ()) -> bool:
    """Whether `make test` leaves a test (`file::test`) with these markers and fixtures to `make test-all`."""
    on_postgres = "postgres" in markers and name.split("::")[0] not in POSTGRES
    return on_postgres or "firefox" in markers or REAL_RECORDINGS in fixtures or entry_of(name) is not None


@cache
def entry_of(name: str) -> str | None:
    """The entry of `LONG` that names a test or a file: itself, its file or a folder."""
    names = (name, name.split("::")[0])
    return next((entry for entry in LONG if entry in names or is_below(entry, name)), None)


def is_below(entry: str, name: str) -> bool:
    """Whether an entry is a folder that holds this file."""
    return entry.endswith("/") and name.startswith(entry)
