"""What `server doctor` looks at of backups and snapshots."""

from collections.abc import Iterator
from datetime import timedelta

from experiments.counted import counted
from experiments.errors import InputError
from server.clock import now
from server.context import Services
from server.operations.findings import Finding
from server.operations.snapshots import changed_at, database_file, set_aside, snapshots_of
from server.operations.watched_backups import OLD_AFTER_S, WatchedBackups, watched_backups
from server.settings import Settings

LATE_AFTER = 3
"""Times between two snapshots after which one is missed."""


def backups(services: Services) -> Iterator[Finding]:
    """Backups are made, and one was brought back."""
    try:
        watched = watched_backups(services.settings)
    except InputError as error:
        yield Finding("backups", "failed", str(error), "see why their store cannot be reached")
        return
    if watched is None:
        yield Finding("backups", "ok", "not watched: PALPEBRA_BACKUP_FOLDER is not set")
        return
    if watched.age_s is None:
        yield Finding("backups", "warning", "there is none", "run: server backup, each day")
        return
    said = f"the newest is {watched.age_s / 3600:.0f} h old"
    fine = watched.age_s <= OLD_AFTER_S
    yield Finding(
        "backups", "ok" if fine else "warning", said, "" if fine else "see why no newer one is made"
    )
    yield _drilled(watched)


def _drilled(watched: WatchedBackups) -> Finding:
    drill = watched.drill
    if drill is None and watched.drilled_elsewhere:
        return Finding(
            "restore drill",
            "warning",
            "not here",
            "run where the private key is: server drill --identity FILE",
        )
    if drill is None:
        return Finding("restore drill", "warning", "none was made", "run: server drill")
    if not drill.passed:
        advice = "make a backup anew and run: server drill"
        return Finding("restore drill", "failed", f"{drill.backup}: {drill.said}", advice)
    return Finding(
        "restore drill", "ok", f"{drill.backup} came back whole on {drill.at:%Y-%m-%d}, {drill.rows} rows"
    )


def snapshots(services: Services) -> Iterator[Finding]:
    """Snapshots are taken where the settings ask for them; no database of before is forgotten."""
    settings = services.settings
    if not services.database.is_sqlite:
        if settings.snapshot_minutes:
            advice = "unset PALPEBRA_SNAPSHOT_MINUTES; PostgreSQL has deploy/point-in-time.sh"
            yield Finding("snapshots", "warning", "asked for, but they are of SQLite alone", advice)
        return
    if settings.snapshot_minutes:
        yield _taken(settings)
    for path in set_aside(settings):
        advice = f"it holds everybody's answers, erased ones too: once all is well, remove {path}"
        yield Finding("database of before", "warning", path.name, advice)


def _taken(settings: Settings) -> Finding:
    there = snapshots_of(settings)
    if not there:
        return Finding("snapshots", "warning", "there is none", "start the server, which takes them")
    newest = there[-1].taken_at
    age_min = (now() - newest).total_seconds() / 60
    said = f"{counted(len(there), 'snapshot')}, the newest {age_min:.0f} min old"
    late = changed_at(database_file(settings)) - newest > timedelta(
        minutes=LATE_AFTER * settings.snapshot_minutes
    )
    advice = "see why the server takes no newer one, in its log" if late else ""
    return Finding("snapshots", "warning" if late else "ok", said, advice)
