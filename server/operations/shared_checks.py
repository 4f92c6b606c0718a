"""What the doctor looks at where hosts share: the ledger of erasures, and what stands before PostgreSQL."""

import shlex
from collections.abc import Iterator

from server.context import Services
from server.operations import erasures, repository
from server.operations.findings import Finding


def ledger(services: Services) -> Iterator[Finding]:
    """A ledger that was kept before PALPEBRA_SHARED_FOLDER was set is in the one that is kept now."""
    settings = services.settings
    before = settings.data_folder / erasures.NAME
    if settings.shared_folder is None or not before.is_file():
        yield Finding("ledger of erasures", "ok", str(erasures.ledger(settings)))
        return
    kept = erasures.merged(erasures.content(settings), b"")
    missing = len(erasures.merged(kept, before.read_bytes()).splitlines()) - len(kept.splitlines())
    if missing:
        said = f"{missing} of the lines of {before} are not in {erasures.ledger(settings)}"
        # Added at the end, so that what the new one gains meanwhile stays; `echo` ends a line cut off.
        one, other = (shlex.quote(str(path)) for path in (before, erasures.ledger(settings)))
        advice = (
            "a restore would bring these people back; as the server's user, run: "
            f"(umask 077; {{ echo; cat {one}; }} >> {other})"
        )
        yield Finding("ledger of erasures", "failed", said, advice)
    else:
        yield Finding("ledger of erasures", "ok", f"{erasures.ledger(settings)} has all that was kept before")


def connection_pool(services: Services) -> Iterator[Finding]:
    """No pool before PostgreSQL takes a session's connection away between two of its transactions."""
    if services.database.is_sqlite:
        return
    if repository.session_is_kept(services.database.engine):
        yield Finding("sessions", "ok", "each keeps its connection to PostgreSQL")
        return
    advice = (
        "locks and LISTEN belong to a session: set pool_mode = session for this database "
        "(PgBouncer), or let DATABASE_URL lead to PostgreSQL itself"
    )
    said = "a pool in transaction mode stands before PostgreSQL"
    yield Finding("sessions", "failed", said, advice)
