"""`server doctor`: every check says what it found and, where it is wrong, what to do."""

import os
import shlex
import shutil
import sqlite3
import stat
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from itertools import islice
from pathlib import Path
from typing import Literal

from sqlalchemy.exc import SQLAlchemyError

from experiments.errors import InputError, counted
from server.accounts.schemas import TOKEN_DAYS_MAX
from server.context import Services
from server.core.db import COUNTING_POOL
from server.core.migrate import current_revision, is_up_to_date
from server.core.row_security import OLDEST_POSTGRES as OLDEST_WITH_WALL
from server.core.row_security import ROLE
from server.core.settings import KEY_LENGTH_MIN, Settings, secret_key_path
from server.core.storage import open_to_others, own_folders
from server.core.values import now
from server.operations import repository
from server.operations.metrics import seen_proxy
from server.operations.snapshots import changed_at, database_file, set_aside, snapshots_of
from server.operations.watched_backups import OLD_AFTER_S, WatchedBackups, watched_backups
from server.participation.identity_repository import readable_identities
from server.participation.recruiter import refused_addresses
from server.participation.tally_pools import Recount
from server.privacy.ledger import LEDGER_NAME, ledger_content, ledger_path, merge_ledgers

# What a check of `server doctor` says.

Verdict = Literal["ok", "warning", "failed"]


@dataclass(frozen=True)
class Finding:
    """One line of the doctor: what was looked at, how it is, what was found, what to do."""

    subject: str
    verdict: Verdict
    state: str
    advice: str = ""


# What `server doctor` looks at of backups and snapshots.

LATE_AFTER = 3
"""Times between two snapshots after which one is missed."""


def backups(services: Services) -> Iterator[Finding]:
    """Backups are made, and one was brought back."""
    try:
        watched = watched_backups(services.settings)
    except InputError as error:
        yield Finding("backups", "failed", str(error), "check why the backup store cannot be reached")
        return
    if watched is None:
        yield Finding("backups", "ok", "not monitored: PALPEBRA_BACKUP_FOLDER is not set")
        return
    if watched.age_s is None:
        yield Finding("backups", "warning", "there is none", "run `server backup` every day")
        return
    said = f"the newest is {watched.age_s / 3600:.0f} h old"
    fine = watched.age_s <= OLD_AFTER_S
    yield Finding(
        "backups", "ok" if fine else "warning", said, "" if fine else "check why there is no newer backup"
    )
    yield _drill_finding(watched)


def _drill_finding(watched: WatchedBackups) -> Finding:
    drill = watched.drill
    if drill is None and watched.drilled_elsewhere:
        return Finding(
            "restore drill",
            "warning",
            "not here",
            "on the machine with the private key, run: server drill --identity FILE",
        )
    if drill is None:
        return Finding("restore drill", "warning", "none was made", "run: server drill")
    if not drill.passed:
        advice = "make a new backup and run: server drill"
        return Finding("restore drill", "failed", f"{drill.backup}: {drill.said}", advice)
    return Finding(
        "restore drill",
        "ok",
        f"{drill.backup} came back whole on {drill.at:%Y-%m-%d}, {counted(drill.rows, 'row')}",
    )


def snapshots(services: Services) -> Iterator[Finding]:
    """Snapshots are taken where the settings ask for them; no replaced database is forgotten."""
    settings = services.settings
    if not services.database.is_sqlite:
        if settings.snapshot_minutes:
            advice = "unset PALPEBRA_SNAPSHOT_MINUTES; PostgreSQL has deploy/point-in-time.sh"
            yield Finding("snapshots", "warning", "enabled, but they only exist for SQLite", advice)
        return
    if settings.snapshot_minutes:
        yield _snapshot_finding(settings)
    for path in set_aside(settings):
        advice = f"it contains all answers, including erased ones; when everything works, remove {path}"
        yield Finding("replaced database", "warning", path.name, advice)


def _snapshot_finding(settings: Settings) -> Finding:
    there = snapshots_of(settings)
    if not there:
        return Finding("snapshots", "warning", "there is none", "start the server, which takes snapshots")
    newest = there[-1].taken_at
    age_min = (now() - newest).total_seconds() / 60
    said = f"{counted(len(there), 'snapshot')}, the newest {age_min:.0f} min old"
    late = changed_at(database_file(settings)) - newest > timedelta(
        minutes=LATE_AFTER * settings.snapshot_minutes
    )
    advice = "check the server log for why there is no newer snapshot" if late else ""
    return Finding("snapshots", "warning" if late else "ok", said, advice)


# What the doctor looks at further: the ledger of erasures, the pool of PostgreSQL, return addresses.


def ledger(services: Services) -> Iterator[Finding]:
    """A ledger that was kept before PALPEBRA_SHARED_FOLDER was set is in the one that is kept now."""
    settings = services.settings
    before = settings.data_folder / LEDGER_NAME
    if settings.shared_folder is None or not before.is_file():
        yield Finding("ledger of erasures", "ok", str(ledger_path(settings)))
        return
    kept = merge_ledgers(ledger_content(settings), b"")
    missing = len(merge_ledgers(kept, before.read_bytes()).splitlines()) - len(kept.splitlines())
    if missing:
        said = f"{missing} of the lines of {before} are not in {ledger_path(settings)}"
        # Added at the end, so that what the new one gains meanwhile stays; `echo` ends a line cut off.
        one, other = (shlex.quote(str(path)) for path in (before, ledger_path(settings)))
        advice = (
            "a restore would bring back erased data; as the server's user, run: "
            f"(umask 077; {{ echo; cat {one}; }} >> {other})"
        )
        yield Finding("ledger of erasures", "failed", said, advice)
    else:
        yield Finding("ledger of erasures", "ok", f"{ledger_path(settings)} contains all earlier entries")


def connection_pool(services: Services) -> Iterator[Finding]:
    """No pool before PostgreSQL takes a session's connection away between two of its transactions."""
    if services.database.is_sqlite:
        return
    if repository.session_is_kept(services.database.engine):
        yield Finding("sessions", "ok", "sessions keep their connection to PostgreSQL")
        return
    advice = (
        "locks and LISTEN need a session: set pool_mode = session for this database (PgBouncer), or point "
        "DATABASE_URL directly to PostgreSQL"
    )
    said = "a connection pool in transaction mode is in front of PostgreSQL"
    yield Finding("sessions", "failed", said, advice)


def return_addresses(services: Services) -> Iterator[Finding]:
    """Return addresses that an earlier release took and nobody is sent to any more."""
    with services.database.read() as session:
        stored = repository.recruiters(session)
    refused = [(study, of_link) for study, of_link, declared in stored if refused_addresses(declared)]
    named = [f"{study} (links of it)" if of_link else study for study, of_link in dict.fromkeys(refused)]
    if named:
        said = f"no longer accepted, so participants are not redirected: {', '.join(named[:5])}"
        advice = "on the study's page, under Running, write out the host of the URL; create these links again"
        yield Finding("return addresses", "warning", said + (", ..." if len(named) > 5 else ""), advice)
    else:
        yield Finding("return addresses", "ok", "each has a fixed host")


# What `server doctor` looks at; each check says what it found and, where it is wrong, what to do.

RAISE_THE_WALL = (
    f"the server's own checks are the only wall: take PostgreSQL {OLDEST_WITH_WALL // 10000} or newer, as an "
    f"administrator of it CREATE ROLE {ROLE} NOLOGIN and GRANT it to the server's user, then run: "
    "server database upgrade"
)
LONGER_KEY = (
    f"set PALPEBRA_SECRET_KEY to at least {KEY_LENGTH_MIN} random characters, keep the old one in a file, "
    "and run: server database rewrap OLD_KEY_FILE"
)
LEAST_FREE_BYTES = 2 * 1024**3
OLDEST_PYTHON, OLDEST_SQLITE, OLDEST_POSTGRES = (3, 11), (3, 38, 0), 130000


def python(_services: Services) -> Iterator[Finding]:
    """The interpreter is recent enough."""
    version = ".".join(map(str, sys.version_info[:3]))
    fine = sys.version_info >= OLDEST_PYTHON
    yield Finding(
        "python", "ok" if fine else "failed", version, "" if fine else "install Python 3.11 or newer"
    )


def late_entry(services: Services) -> str | None:
    """How far the machine's clock is behind the database; None if it is not.

    An hour is allowed: clocks are set forward and back by less than that.
    """
    with services.database.read() as session:
        newest = repository.newest_entry(session)
    if newest is None or newest <= now() + timedelta(hours=1):
        return None
    shown, stored = f"{now():%Y-%m-%d %H:%M}", f"{newest:%Y-%m-%d %H:%M}"
    return (
        f"the clock of this machine shows {shown} UTC, "
        f"but the newest entry of the database is from {stored} UTC"
    )


def clock(services: Services) -> Iterator[Finding]:
    """The clock is not behind what was stored, else times and their order would be wrong."""
    late = late_entry(services)
    advice = "set the clock" if late else ""
    yield Finding("clock", "failed" if late else "ok", late or "not behind the database", advice)


def data_folder(services: Services) -> Iterator[Finding]:
    """The data folder can be written and has room, and so can the one that hosts share."""
    yield from _folder("data folder", services.settings.data_folder, "PALPEBRA_DATA_FOLDER")
    if (shared := services.settings.shared_folder) is not None:
        yield from _folder("shared folder", shared, "PALPEBRA_SHARED_FOLDER")


def _folder(subject: str, folder: Path, setting: str) -> Iterator[Finding]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".doctor-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        advice = "give the user that runs the server write permission, or set " + setting
        yield Finding(subject, "failed", f"{folder}: {error.strerror}", advice)
        return
    free = shutil.disk_usage(folder).free
    fine = free >= LEAST_FREE_BYTES
    advice = "" if fine else "free disk space: a full disk stops all ratings"
    yield Finding(subject, "ok" if fine else "warning", f"{folder}, {free / 1e9:.1f} GB free", advice)


def file_modes(services: Services) -> Iterator[Finding]:
    """Nothing in the data folder can be read by other users."""
    folders = own_folders(services.settings)
    open_files = list(islice((path for folder in folders for path in open_to_others(folder)), 1000))
    if not open_files:
        yield Finding("file modes", "ok", "for this user only")
        return
    more = "or more " if len(open_files) == 1000 else ""
    said = f"{len(open_files)} {more}open to other users of this computer, such as {open_files[0]}"
    yield Finding("file modes", "failed", said, f"run: chmod -R go= {' '.join(map(str, folders))}")


def secret_key(services: Services) -> Iterator[Finding]:
    """The key is there, and no other user can read it."""
    settings = services.settings
    path = secret_key_path(settings.data_folder)
    if settings.secret_key:
        fine = not settings.has_short_key
        advice = "" if fine else LONGER_KEY
        yield Finding("secret key", "ok" if fine else "warning", "from the environment", advice)
    elif not path.is_file():
        yield Finding("secret key", "ok", "will be created at the first start")
    else:
        mode = stat.S_IMODE(path.stat().st_mode)
        fine = mode & 0o077 == 0
        advice = "" if fine else f"run: chmod 600 {path}"
        yield Finding("secret key", "ok" if fine else "failed", f"{path}, mode {mode:o}", advice)


def database(services: Services) -> Iterator[Finding]:
    """The database opens, has the newest tables and views, and keeps what it acknowledges."""
    opened = services.database
    revision, fine = current_revision(opened), is_up_to_date(opened)
    where = opened.url.render_as_string(hide_password=True)
    said = f"{where}, revision {revision or 'none'}"
    advice = "" if fine else "run: server database upgrade"
    if revision is None:
        advice = (
            "it is empty; check that this is the data folder of your studies (PALPEBRA_DATA_FOLDER); if "
            "so, " + advice
        )
    yield Finding("database", "ok" if fine else "failed", said, advice)
    yield from _sqlite(services) if opened.is_sqlite else _postgres(services)


def _sqlite(services: Services) -> Iterator[Finding]:
    fine = sqlite3.sqlite_version_info >= OLDEST_SQLITE
    advice = "" if fine else "install a Python with SQLite 3.38 or newer"
    yield Finding("SQLite", "ok" if fine else "failed", sqlite3.sqlite_version, advice)
    with services.database.read() as session:
        said = repository.sqlite_complaint(session)
    advice = "" if said == "ok" else "stop the server and restore the last backup: server restore FILE"
    yield Finding("SQLite file", "ok" if said == "ok" else "failed", said, advice)


def _postgres(services: Services) -> Iterator[Finding]:
    with services.database.read() as session:
        number = int(repository.postgres_setting(session, "server_version_num"))
        names = ("fsync", "synchronous_commit")
        durable = {name: repository.postgres_setting(session, name) for name in names}
        allowed = int(repository.postgres_setting(session, "max_connections"))
    fine = number >= OLDEST_POSTGRES
    advice = "" if fine else "use PostgreSQL 13 or newer"
    yield Finding("PostgreSQL", "ok" if fine else "failed", f"version {number // 10000}", advice)
    off = [name for name, value in durable.items() if value == "off"]
    advice = (
        (f"set {' and '.join(off)} on; otherwise, a power failure could lose acknowledged ratings")
        if off
        else ""
    )
    said = ", ".join(f"{name} {value}" for name, value in durable.items())
    yield Finding("durability", "warning" if off else "ok", said, advice)
    apart = services.database.keeps_rows_apart
    advice = "" if apart else RAISE_THE_WALL
    said = "separated by the server and by PostgreSQL" if apart else "separated by the server only"
    yield Finding("laboratories' rows", "ok" if apart else "warning", said, advice)
    needed = 2 * (services.settings.database_pool + COUNTING_POOL) + 2  # locks, changes
    advice = f"a worker may use {needed}; increase max_connections or decrease PALPEBRA_DATABASE_POOL"
    tight = needed + 5 > allowed
    yield Finding("connections", "warning" if tight else "ok", f"{allowed} allowed", advice if tight else "")


def counts(services: Services) -> Iterator[Finding]:
    """The counts kept with each rating equal a full count of the ratings."""
    compared = Recount(services.versions)
    with services.database.snapshot() as session:
        wrong = sum(1 for _ in compared.differing(session))
    if wrong:
        advice = "run: server database recount"
        yield Finding(
            "counts",
            "failed",
            f"the stored counts of {wrong} of {counted(compared.runs, 'run')} differ from their ratings",
            advice,
        )
    else:
        yield Finding("counts", "ok", f"stored counts match the ratings in {counted(compared.runs, 'run')}")


def identities(services: Services) -> Iterator[Finding]:
    """Recruiters' IDs can be read with the installation's key."""
    with services.database.read() as session:
        counted = Counter(readable_identities(session))
    if counted[False]:
        said = f"{counted[False]} of {counted.total()} recruiters' IDs cannot be read"
        advice = "the secret key was changed; run: server database rewrap OLD_KEY_FILE"
        yield Finding("recruiters' IDs", "failed", said, advice)
    else:
        yield Finding("recruiters' IDs", "ok", f"{counted.total()}, each encrypted with a separate key")


def clips(services: Services) -> Iterator[Finding]:
    """Every clip that a study names is in the store, with the right length."""
    with services.database.read() as session:
        named = repository.clip_sizes(session)
    wrong = [sha256 for sha256, size in named if services.clips.size(sha256) != size]
    if wrong:
        advice = "add the study again from its clips (server study add), or restore a backup"
        yield Finding("clips", "failed", f"{len(wrong)} of {len(named)} missing or incomplete", advice)
    else:
        yield Finding("clips", "ok", f"{len(named)}, all present")


def pages(services: Services) -> Iterator[Finding]:
    """The pages are built."""
    for site in ("participant", "admin"):
        path = services.settings.frontend_folder / site / "index.html"
        advice = "" if path.is_file() else "run `make run` in the checkout, or install Palpebra again"
        said = "built" if path.is_file() else f"no {path}"
        yield Finding(f"{site} page", "ok" if path.is_file() else "failed", said, advice)


def public_address(services: Services) -> Iterator[Finding]:
    """Participants reach the server by https, without which browsers give no exact playback."""
    settings = services.settings
    local = settings.is_local
    fine = settings.is_https or local
    advice = (
        "" if fine else "put https in front (docs/how-to/deploy.md) and set PALPEBRA_PUBLIC_URL=https://..."
    )
    yield Finding("public address", "ok" if fine else "failed", settings.public_url, advice)
    if local:
        advice = "set PALPEBRA_PUBLIC_URL before you send links to people on other machines"
        yield Finding("who can reach it", "warning", "only this machine", advice)


def proxy(services: Services) -> Iterator[Finding]:
    """Sign-in limits count addresses of people, not that of a proxy."""
    seen = seen_proxy(services.settings.data_folder)
    if seen is None:
        yield Finding("proxy", "ok", "none missing in FORWARDED_ALLOW_IPS within the last day")
        return
    said = (
        f"{seen.address} forwards requests but is not in FORWARDED_ALLOW_IPS: sign-in limits treat "
        f"everyone as this address "
        f"(last seen {seen.seen_at:%Y-%m-%d %H:%M} UTC)"
    )
    advice = (
        f"if this is your proxy, set FORWARDED_ALLOW_IPS={seen.address}, make it send X-Forwarded-For, and "
        f"restart the server"
    )
    yield Finding("proxy", "warning", said, advice)


def people(services: Services) -> Iterator[Finding]:
    """Somebody can sign in; there is something to take part in."""
    with services.database.read() as session:
        owners = repository.owner_count(session)
        without = repository.count_without_second_factor(session)
        studies = repository.study_count(session)
    advice = "" if owners else "run `server admin link`, and open the URL that it prints"
    counted = "1 owner" if owners == 1 else f"{owners} owners"
    yield Finding("accounts", "ok" if owners else "warning", counted, advice)
    if without:
        advice = "ask them to set one up under My account"
        yield Finding("second factor", "warning", f"{without} account{'s' * (without > 1)} without", advice)
    advice = "" if studies else "run: server study add exp3 --clips FOLDER"
    yield Finding("studies", "ok" if studies else "warning", str(studies), advice)


def tokens(services: Services) -> Iterator[Finding]:
    """API tokens made before they had to end within a year."""
    with services.database.read() as session:
        named = repository.tokens_ending_after(session, now() + timedelta(days=TOKEN_DAYS_MAX))
    if named:
        shown = ", ".join(f"{token} ({account})" for token, account in named[:5])
        said = f"{counted(len(named), 'API token')} without expiry, or valid for years: {shown}"
        advice = "ask their owners to revoke them (My account) and create new ones"
        yield Finding("API tokens", "warning", said + (", ..." if len(named) > 5 else ""), advice)
    else:
        yield Finding("API tokens", "ok", "all expire within a year")


CHECKS: tuple[Callable[[Services], Iterator[Finding]], ...] = (
    python,
    clock,
    data_folder,
    file_modes,
    secret_key,
    database,
    connection_pool,
    ledger,
    counts,
    identities,
    clips,
    pages,
    public_address,
    proxy,
    people,
    tokens,
    return_addresses,
    backups,
    snapshots,
)
"""In the order in which one would put things right."""


# `server doctor`: run every check and say what to fix.


def examine(services: Services) -> list[Finding]:
    """All findings; a check that cannot be made because of an earlier trouble says so."""
    findings: list[Finding] = []
    for check in CHECKS:
        try:
            findings.extend(check(services))
        except SQLAlchemyError as error:
            origin = getattr(error, "orig", None) or error
            said = str(origin).strip().splitlines()[0]
            advice = "see DATABASE_URL, then run: server database upgrade"
            findings.append(Finding(check.__name__.replace("_", " "), "failed", said, advice))
    return findings


def findings_for_studies(services: Services) -> list[Finding]:
    """What matters before a study goes live: room on the disk, backups, and the address of links."""
    return [finding for check in (data_folder, backups, public_address) for finding in check(services)]
