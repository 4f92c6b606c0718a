"""What the doctor looks at further: the ledger of erasures, the pool of PostgreSQL, return addresses."""

import shlex
from collections.abc import Iterator

from server.context import Services
from server.operations import erasures, repository
from server.operations.findings import Finding
from server.participants.recruiter import refused_addresses


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


def return_addresses(services: Services) -> Iterator[Finding]:
    """Return addresses that an earlier release took and nobody is sent to any more."""
    with services.database.read() as session:
        stored = repository.recruiters(session)
    refused = [(study, of_link) for study, of_link, declared in stored if refused_addresses(declared)]
    named = [f"{study} (links of it)" if of_link else study for study, of_link in dict.fromkeys(refused)]
    if named:
        said = f"refused today, so participants are sent nowhere: {', '.join(named[:5])}"
        advice = "on the study's page, under Running, write the host of the address out; make such links anew"
        yield Finding("return addresses", "warning", said + (", ..." if len(named) > 5 else ""), advice)
    else:
        yield Finding("return addresses", "ok", "each has a host that is written out")
