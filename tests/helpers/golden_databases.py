"""The golden databases of revisions after 0001 (tests/golden/databases), and what they must still hold."""

import gzip
import hashlib
import json
from pathlib import Path
from typing import Any

import psycopg
from sqlalchemy.engine import make_url

from server.core.db import Database
from server.privacy.rows import read_rows, snapshot, tables_of
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "tests" / "golden" / "databases"
SECRET_KEY = "the golden databases of the tests, a key"
REVISIONS = sorted(path.name.removesuffix(".contents.json.gz") for path in FOLDER.glob("*.contents.json.gz"))


def load_golden_database(revision: str, url: str) -> None:
    """Put a golden database with its rows at this empty address."""
    parts = make_url(url)
    if parts.get_backend_name() == "sqlite":
        Path(str(parts.database)).write_bytes(golden_file(f"{revision}.sqlite"))
        return
    plain = parts.set(drivername="postgresql").render_as_string(hide_password=False)
    with psycopg.connect(plain) as connection:
        connection.execute(golden_file(f"{revision}.postgresql.sql"))


def golden_file(name: str) -> bytes:
    """A file of the folder, unpacked."""
    return gzip.decompress((FOLDER / f"{name}.gz").read_bytes())


def golden_contents(revision: str) -> dict[str, Any]:
    """What each table held when the database was made, as `contents_of` gives it."""
    contents: dict[str, Any] = json.loads(golden_file(f"{revision}.contents.json"))
    return contents


def golden_ratings(revision: str) -> dict[str, bytes]:
    """The ratings CSV of each study, as the program of that revision exported it."""
    begin, end = f"{revision}.", ".ratings.csv.gz"
    names = [path.name for path in FOLDER.glob(f"{begin}*{end}")]
    return {name[len(begin) : -len(end)]: golden_file(name[:-3]) for name in sorted(names)}


def contents_of(database: Database, known: dict[str, Any] | None = None) -> dict[str, Any]:
    """Columns, number of rows and hash over all rows of each table.

    With `known`, what another program's database held, only of its tables and over its columns: a later
    revision may add some.
    """
    contents = {}
    with snapshot(database) as connection:
        for table in tables_of(connection):
            if known is not None and table.name not in known:
                continue
            columns = (
                known[table.name]["columns"] if known else sorted(column.name for column in table.columns)
            )
            digest, count = hashlib.sha256(), 0
            for row in read_rows(connection, table):
                line = json.dumps({name: row[name] for name in columns}, sort_keys=True, ensure_ascii=False)
                digest.update(line.encode() + b"\n")
                count += 1
            contents[table.name] = {"columns": columns, "rows": count, "sha256": digest.hexdigest()}
    return contents
