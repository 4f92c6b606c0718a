"""What the command groups share: the migrated database of the settings."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from sqlalchemy.exc import OperationalError

from experiments.errors import InputError
from server.context import Services, open_services
from server.migrate import current_revision, known_revision, upgrade
from server.settings import Settings

out = Console(soft_wrap=True, highlight=False)


@contextmanager
def migrated_services(settings: Settings | None = None) -> Iterator[Services]:
    """Database and clip store of the settings, the database brought to the newest revision."""
    services = open_services(settings or Settings())
    try:
        found = _found_revision(services)
        if found is not None and not known_revision(found):
            raise InputError(
                f"the database has revision {found}, which this program does not know; "
                "it was written by a newer version, install that one"
            )
        upgrade(services.database)
        yield services
    finally:
        services.database.close()


def _found_revision(services: Services) -> str | None:
    try:
        return current_revision(services.database)
    except OperationalError as error:
        address = services.database.url.render_as_string(hide_password=True)
        reason = str(error.orig).strip().splitlines()[0]
        raise InputError(f"cannot open the database {address}: {reason}") from error
