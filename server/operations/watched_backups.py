"""How the backups are: the age of the newest, which ones stay, and how the last drill went."""

import math
import re
import time
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from pydantic import AwareDatetime, BaseModel, ValidationError

from server.core.settings import Settings
from server.core.values import now
from server.operations.backup import ENDING
from server.operations.backup_stores import (
    SCHEME,
    BackupStore,
    Entry,
    StoredBackup,
    backup_store,
    backups_in,
    installation_of,
)
from server.operations.key_escrow import installation

# How the backups are: the age of the newest, and how the last drill went.

OLD_AFTER_S = 2 * 86400
"""A backup a day is usual; when the newest is older than two days something stopped."""
ASK_AGAIN_S = 300.0


class DrillResult(BaseModel):
    """How a drill went.

    Attributes
    ----------
    at : datetime
        When it ended.
    backup, backed_up_at : str
        Name of the file, and when it was written by its own word; empty where it could not be read.
    passed : bool
    said : str
        What was wrong; empty where nothing was.
    rows, clips : int
    seconds : float
    """

    at: AwareDatetime
    backup: str
    backed_up_at: str = ""
    passed: bool
    said: str = ""
    rows: int = 0
    clips: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class WatchedBackups:
    """This installation's backups in the folder of the settings.

    Attributes
    ----------
    number : int
        How many there are.
    newest : str or None
        Name of the backup written last.
    age_s : float or None
        Its age.
    drill : DrillResult or None
        The last drill, whatever backup it was made on.
    drilled_elsewhere : bool
        The newest is encrypted, and this server has no private key.
    """

    number: int
    newest: str | None
    age_s: float | None
    drill: DrillResult | None
    drilled_elsewhere: bool = False


def watched_backups(settings: Settings) -> WatchedBackups | None:
    """Look at the backups; None where the settings name no folder.

    Raises
    ------
    InputError
        The object store does not answer.
    """
    if not settings.backup_folder:
        return None
    backups = _entries(settings)
    drilled = last_drill(settings)
    if not backups:
        return WatchedBackups(0, None, None, drilled)
    newest = backups[-1]
    age_s = (now() - newest.written_at).total_seconds()
    elsewhere = newest.name.endswith(ENDING) and settings.backup_identity is None
    return WatchedBackups(len(backups), newest.name, age_s, drilled, elsewhere)


def _entries(settings: Settings) -> list[Entry]:
    """The backups; an object store is asked now and then alone, as metrics are asked for all the time."""
    address = str(settings.backup_folder)
    asked_at, entries = _asked.get(address, (-math.inf, []))
    if address.startswith(SCHEME) and time.monotonic() - asked_at < ASK_AGAIN_S:
        return entries
    entries = own_backups(backup_store(address, settings), settings.key)
    _asked[address] = (time.monotonic(), entries)
    return entries


_asked: dict[str, tuple[float, list[Entry]]] = {}


def own_backups(store: BackupStore, secret: bytes) -> list[Entry]:
    """The backups of a store, oldest first, but for those whose name is another installation's.

    Backups that are not encrypted name no installation; they count as one's own.
    """
    return [one for one in backups_in(store) if installation_of(one.name) in (None, installation(secret))]


def newest_backup(store: BackupStore, secret: bytes | None = None) -> StoredBackup | None:
    """The backup written last; None where there is none.

    Parameters
    ----------
    secret : bytes, optional
        The secret key of the installation whose backups count; any where not given.
    """
    backups = backups_in(store) if secret is None else own_backups(store, secret)
    return StoredBackup(store, backups[-1].name) if backups else None


def drill_file(settings: Settings) -> Path:
    """Where the result of the last drill is kept."""
    return settings.common_folder / "restore-drill.json"


def last_drill(settings: Settings) -> DrillResult | None:
    """The result of the last drill; None where none was made, or its file cannot be read."""
    try:
        return DrillResult.model_validate_json(drill_file(settings).read_bytes())
    except (OSError, ValidationError):
        return None


# Which backups stay: of each of the newest days its last one, and everything of the newest day.

_NAME = re.compile(r"palpebra-(\d{4}-\d{2}-\d{2})(T\d{6})?(-[0-9a-f]{16})?\.tar(\.age)?")


def day_of(path: Path) -> date | None:
    """The day (UTC) in the name of a backup; None where the name is one that nobody dated."""
    match = _NAME.fullmatch(path.name)
    try:
        return date.fromisoformat(match[1]) if match else None
    except ValueError:
        return None


def superfluous_backups(paths: Iterable[Path], days: int) -> list[Path]:
    """Backups that `--keep DAYS` removes, the oldest first.

    A day counts where there is a backup of it, so that a machine that was off for a month keeps what it has.
    Files with other names stay: somebody named them for a reason.
    """
    by_day: dict[date, list[Path]] = defaultdict(list)
    for path in sorted(paths):
        if (day := day_of(path)) is not None:
            by_day[day].append(path)
    newest = sorted(by_day, reverse=True)
    earlier = {day: by_day[day] if age >= days else by_day[day][:-1] for age, day in enumerate(newest)}
    return [path for day in reversed(newest[1:]) for path in earlier[day]]
