"""The databases of version 0.1.0 (tests/golden/databases), loaded into either kind of database."""

import gzip
from pathlib import Path

import psycopg
from sqlalchemy.engine import make_url

from server.core.db import SIGNING_KEY, Database
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "tests" / "golden" / "databases"
SECRET_KEY = "browser tests"
STUDIES = ("short", "browser")


def load_older_database(url: str) -> Database:
    """The database of revision 0001 with its rows, at this empty address."""
    parts = make_url(url)
    if parts.get_backend_name() == "sqlite":
        Path(str(parts.database)).write_bytes(_golden("0001.sqlite.gz"))
    else:
        plain = parts.set(drivername="postgresql").render_as_string(hide_password=False)
        with psycopg.connect(plain) as connection:
            connection.execute(_golden("0001.postgresql.sql.gz"))
    return opened(url)


def opened(url: str) -> Database:
    """With the installation's key, as the upgrade needs it."""
    return Database(url, carried={SIGNING_KEY: lambda: SECRET_KEY.encode()})


def older_ratings_csv(study: str) -> bytes:
    """The ratings of a study as that program exported them."""
    return _golden(f"{study}.ratings.csv.gz")


def _golden(name: str) -> bytes:
    return gzip.decompress((FOLDER / name).read_bytes())
