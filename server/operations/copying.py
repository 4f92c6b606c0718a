"""A database copied row for row into another, and carried over to another secret key."""

from collections.abc import Callable
from dataclasses import dataclass

from sqlalchemy import make_url
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from experiments.errors import InputError
from server.accounts import repository as accounts
from server.accounts.audit import SECOND_FACTOR_SET_UP, entries_under_key, record, reseal, verify
from server.accounts.credentials import rewrap_secret
from server.accounts.identity import OPERATOR
from server.accounts.repository import hold_chain
from server.core.db import Database
from server.core.migrate import current_revision, newest_revision, upgrade
from server.core.settings import Settings
from server.participation.identity_repository import rewrap_all
from server.privacy.rows import (
    Content,
    content_of,
    read_rows,
    refuse_unless_empty,
    snapshot,
    tables_of,
    write_rows,
)

# `server database copy`: every row of one database into another, compared afterwards.


def copy_database(
    source_url: str, target_url: str, told: Callable[[str, Content], None] = lambda _name, _content: None
) -> dict[str, Content]:
    """Copy all tables; return what each holds, the same in both.

    The target is migrated and must be empty. All rows are written in one transaction, read back and compared
    before it is committed: where anything differs nothing is left behind.

    Raises
    ------
    InputError
        A database cannot be opened, the source is not of the newest revision, the target is not empty, or
        what was read back differs from what was written.
    """
    source, target = _open_by_url(source_url), _open_by_url(target_url)
    try:
        if source.url == target.url:
            raise InputError("source and target are the same database; use two different URLs")
        _check_revision(source)
        upgrade(target)
        return _copy(source, target, told)
    finally:
        source.close()
        target.close()


def _copy(source: Database, target: Database, told: Callable[[str, Content], None]) -> dict[str, Content]:
    copied: dict[str, Content] = {}
    with snapshot(source) as reading, target.write_connection() as writing:
        refuse_unless_empty(writing, address(target.url.render_as_string()), "use an empty database")
        into = {table.name: table for table in tables_of(writing)}
        for table in tables_of(reading):
            written = write_rows(writing, into[table.name], read_rows(reading, table))
            content = content_of(writing, into[table.name])
            if content != written:
                raise InputError(
                    f"table {table.name}: {written.rows} rows were written, but {content.rows} were read "
                    f"back or their values differ; nothing was kept, please report this"
                )
            copied[table.name] = content
            told(table.name, content)
    return copied


def address(url: str) -> str:
    """An address without its password."""
    return make_url(url).render_as_string(hide_password=True)


def _open_by_url(url: str) -> Database:
    try:
        return Database(Settings(database_url=url).resolved_database_url, pool=2)
    except Exception as error:
        raise InputError(
            f"expected a URL such as sqlite:///palpebra.sqlite or postgresql://me@host/name, got '{url}'"
        ) from error


def _check_revision(source: Database) -> None:
    try:
        revision, expected = current_revision(source), newest_revision()
    except OperationalError as error:
        reason = str(error.orig).strip().splitlines()[0]
        raise InputError(f"cannot open {address(source.url.render_as_string())}: {reason}") from error
    if revision != expected:
        raise InputError(
            f"the source has revision {revision}, expected {expected}; "
            "run `server database upgrade` with DATABASE_URL set to it first"
        )


# After the secret key was changed: carry over what was kept under the old one.


@dataclass(frozen=True)
class RekeyedSecrets:
    """What is under the key of now.

    Attributes
    ----------
    identities, unreadable : int
        Recruiters' IDs whose keys were wrapped again, and those that are not under the old key.
    second_factors : int
        Of accounts.
    broken : str or None
        Why the audit log and second factors were left as they are; None where all was carried over.
    """

    identities: int
    unreadable: int
    second_factors: int
    broken: str | None


def carry_over(session: Session, old: bytes, secret: bytes) -> RekeyedSecrets:
    """Wrap recruiters' IDs and second factors under the key of now, and make the audit log's chain by it.

    A log that fits neither key is left as it is: it must not become whole by this. So are second factors
    then, since only the log says under which key each was set up; recruiters' IDs say it themselves.

    Raises
    ------
    InputError
        Nothing is under the old key: it never was this server's, or all was carried over before.
    """
    # Accounts before the chain, as a sign-in holds them: in the other order the two wait for one another.
    accounts.with_second_factor(session)
    hold_chain(session)
    before = verify(session, secret, before=old)
    done, left = rewrap_all(session, old)
    if not done and not any(entries_under_key(session, old)):
        raise InputError(
            "nothing on this server is encrypted with this key: it was never used here, or everything is "
            "already re-encrypted"
        )
    if before.broken is not None:
        return RekeyedSecrets(done, left, 0, before.broken)
    factors = _carry_factors(session, old, secret)
    reseal(session, secret)
    head = f"{before.position}:{before.hash}"
    record(session, OPERATOR, "secret key changed", "", "", head_before=head)
    return RekeyedSecrets(done, left, factors, None)


def _carry_factors(session: Session, old: bytes, secret: bytes) -> int:
    """Carry over second factors, except those set up under the new key; returns how many."""
    of_now = {
        entry.account_id
        for entry in entries_under_key(session, secret)
        if entry.action == SECOND_FACTOR_SET_UP
    }
    # Read again: looking through the log forgets what was read before.
    holders = [holder for holder in accounts.with_second_factor(session) if holder.id not in of_now]
    for holder in holders:
        holder.totp_secret = rewrap_secret(old, secret, holder.totp_secret or "")
    return len(holders)
