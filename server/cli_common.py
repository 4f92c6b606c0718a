"""What the command groups share: the migrated database of the settings, and how refusals are put."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails
from rich.console import Console
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from experiments.errors import InputError, did_you_mean, wrong_value
from server.context import Services, open_services
from server.core.db import Database, checked_url, is_away, is_busy
from server.core.errors import ApiError
from server.core.migrate import current_revision, known_revision, upgrade
from server.core.settings import KEY_LENGTH_MIN, Settings

# What the command groups share: the migrated database of the settings.

out = Console(soft_wrap=True, highlight=False, markup=False)
Word = TypeVar("Word", bound=str)


@contextmanager
def migrated_services(settings: Settings | None = None, *, stored: bool = False) -> Iterator[Services]:
    """Database and clip store of the settings, the database brought to the newest revision.

    Where something must be `stored`, a database without tables is refused.
    """
    services = open_services(settings or Settings())
    try:
        revision = _stored_revision(services.database)
        if revision is None and stored:
            address = services.database.url.render_as_string(hide_password=True)
            raise _no_database(address, "an empty database at")
        if revision is not None and not known_revision(revision):
            raise InputError(
                f"the database has revision {revision}, which a newer version of this program wrote; "
                f"install that version"
            )
        if revision is None and services.settings.has_short_key and not services.settings.is_local:
            raise InputError(
                f"PALPEBRA_SECRET_KEY: expected at least {KEY_LENGTH_MIN} random characters for a new "
                f"database, got {len(services.settings.secret_key)}; leave it empty to generate one in the "
                f"data folder"
            )
        upgrade(services.database)
        yield services
    finally:
        services.database.close()


@contextmanager
def stored_services(settings: Settings | None = None) -> Iterator[Services]:
    """Database and clip store of the settings, for commands on what is already there.

    Raises
    ------
    InputError
        There is no database yet, or it has no tables: in a folder next to the server's, an empty one made on
        the spot would look as if all studies were lost, and its backup as if they were kept.
    """
    settings = settings or Settings()
    require_database(settings)
    with migrated_services(settings, stored=True) as services:
        yield services


def require_database(settings: Settings) -> None:
    """Refuse a SQLite file that is not there with InputError, before opening makes an empty one."""
    url = checked_url(settings.resolved_database_url)
    if url.get_backend_name() == "sqlite" and url.database and not Path(url.database).exists():
        raise _no_database(url.database, "no database at")


def _no_database(address: str, what: str) -> InputError:
    return InputError(
        f"there is {what} {address}; run this in the folder of the server, or set PALPEBRA_DATA_FOLDER "
        f"to the data folder that the server printed, or DATABASE_URL"
    )


def _stored_revision(database: Database) -> str | None:
    try:
        return current_revision(database)
    except OperationalError as error:
        address = database.url.render_as_string(hide_password=True)
        reason = str(error.orig).strip().splitlines()[0]
        raise InputError(f"cannot open the database {address}: {reason}") from error


def one_of(words: Sequence[Word], word: str, what: str) -> Word:
    """The word as one of those known; InputError, with the nearest, where it is none of them."""
    known = next((one for one in words if one == word), None)
    if known is None:
        raise InputError(f"expected {what} {', '.join(words)}, got '{word}'{did_you_mean(word, words)}")
    return known


# What a command was refused for, in one line: by the server itself, or by its settings.


def refusal(error: Exception) -> str | None:
    """The line; None if it is not a refusal."""
    if isinstance(error, ApiError):
        return error.message
    if isinstance(error, ValidationError) and error.title == Settings.__name__:
        return "; ".join(map(_setting, error.errors()))
    if isinstance(error, PoolTimeout):
        return "no database connection became available: try again, or increase PALPEBRA_DATABASE_POOL"
    if is_busy(error):
        return "another program has locked the database: stop it, or try again later"
    if isinstance(error, DBAPIError) and is_away(error):
        said = str(error.orig).strip().splitlines() or ["it does not respond"]
        return f"the database is not reachable ({said[0]}); check DATABASE_URL, then run: server doctor"
    return None


def _setting(problem: ErrorDetails) -> str:
    name = "__".join(map(str, problem["loc"])).upper() or "a setting"
    shown = name if name.startswith(("PALPEBRA_", "DATABASE_")) else f"PALPEBRA_{name}"
    return f"{shown}: {wrong_value(problem)}; see docs/reference/settings.md"
