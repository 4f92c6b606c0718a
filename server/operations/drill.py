"""The newest backup restored next to the data, examined and removed: on request and each week."""

import asyncio
import logging
import shutil
import sys
import tarfile
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager, suppress
from datetime import datetime, timedelta
from pathlib import Path

from pyrage import x25519

from experiments.errors import InputError
from experiments.files import whole_file
from server.context import Services, open_services
from server.core.changes import background_task
from server.core.db import open_database
from server.core.locks import LockTaken, file_lock, open_locks
from server.core.settings import Settings
from server.core.values import now
from server.operations.backup import ENDING, TABLES, Description, identity_in
from server.operations.backup_stores import StoredBackup, backup_store, brought_here
from server.operations.doctor import Finding, counts, database, identities
from server.operations.key_escrow import key_file_of
from server.operations.restore import restore
from server.operations.watched_backups import DrillResult, drill_file, last_drill, newest_backup
from server.privacy.ledger import ledger_path

# `server drill`: restore the newest backup next to the data, examine it, and report how it went.
#
# A backup that nobody has ever brought back is a hope. The server makes the drill itself once a week where it
# knows the folder of its backups.

EVERY = timedelta(days=7)
AGAIN_AFTER_FAILURE = timedelta(days=1)
COPIES = ".drill-"
"""How folders of copies begin."""
UNPACKED = 15
"""Rows in a database take up to this many times the room of their compressed text."""


class DrillUnderWayError(InputError):
    """Another process makes a drill."""


def drill(
    settings: Settings,
    backup: Path | StoredBackup,
    identity: x25519.Identity | None = None,
    keys: Path | None = None,
) -> DrillResult:
    """Restore a backup next to the data and examine it; the result is kept, what was restored is removed.

    The database is SQLite whatever the server's is: a backup has neither's form. Nothing of the server's own
    data is touched; people erased since the backup are erased from the copy too, before it is looked at.

    Parameters
    ----------
    keys : Path, optional
        Key file of a backup that is not encrypted, if it is neither next to it nor in the settings.

    Raises
    ------
    DrillUnderWayError
        Another process is at it.
    """
    with _drill_lock(settings):
        return _drill(settings, backup, identity, keys)


def _drill(
    settings: Settings,
    backup: Path | StoredBackup,
    identity: x25519.Identity | None,
    keys: Path | None = None,
) -> DrillResult:
    if keys is None and not backup.name.endswith(ENDING):
        keys = settings.backup_keys
    started = time.monotonic()
    try:
        with (
            tempfile.TemporaryDirectory(prefix=COPIES, dir=settings.data_folder) as folder,
            _local_backup(settings, backup, Path(folder), identity) as path,
        ):
            _check_room(settings, path)
            result = _brought_back(_drill_settings(settings, Path(folder)), path, keys)
    except InputError as error:
        result = DrillResult(at=now(), backup=backup.name, passed=False, said=str(error))
    except Exception as error:  # whatever goes wrong is what it is there to find
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        result = DrillResult(at=now(), backup=backup.name, passed=False, said=said)
    result = result.model_copy(
        update={"backup": backup.name, "seconds": round(time.monotonic() - started, 1)}
    )
    with whole_file(drill_file(settings)) as temporary:
        temporary.write_text(result.model_dump_json(indent=2), encoding="utf-8")
    return result


@contextmanager
def _local_backup(
    settings: Settings, backup: Path | StoredBackup, folder: Path, identity: x25519.Identity | None
) -> Iterator[Path]:
    """The backup as a file of this machine, in the open."""
    if isinstance(backup, Path):
        yield backup
        return
    size = next((entry.bytes for entry in backup.store.entries() if entry.name == backup.name), 0)
    _need_room(settings, size + settings.free_megabytes_min * 1e6)
    with brought_here(backup, folder, identity) as path:
        yield path


def _brought_back(apart: Settings, backup: Path, keys: Path | None) -> DrillResult:
    services = open_services(apart)
    try:
        described = restore(
            services.database, services.settings, services.clips, backup, keys=keys, despite_erasures=True
        )
        missing = keys is None and not key_file_of(backup).exists()
        failed = [_key_file_missing(backup)] if missing and _needs_key_file(described) else []
        failed += [
            f"{finding.subject}: {finding.state}"
            for finding in _findings(services)
            if finding.verdict == "failed"
        ]
    finally:
        services.database.close()
    return DrillResult(
        at=now(),
        backup=backup.name,
        backed_up_at=described.created_at,
        passed=not failed,
        said="; ".join(failed),
        rows=sum(table.rows for table in described.tables.values()),
        clips=len(described.clips),
    )


def _needs_key_file(described: Description) -> bool:
    known = described.tables.get("recruiter_identities")
    return described.keys_apart and known is not None and known.rows > 0


def _key_file_missing(backup: Path) -> str:
    return (
        f"no key file {key_file_of(backup)}: recruiters' IDs would be lost; specify it with --keys or "
        f"PALPEBRA_BACKUP_KEYS, or run: server backup"
    )


def _check_room(settings: Settings, backup: Path) -> None:
    """Refuse a drill that would leave the raters without room."""
    try:
        with tarfile.open(backup) as tar:
            sizes = [entry.size * (UNPACKED if entry.name.startswith(TABLES) else 1) for entry in tar]
    except (OSError, tarfile.TarError):
        return  # restore says what is wrong with it
    _need_room(settings, sum(sizes) + settings.free_megabytes_min * 1e6)


def _need_room(settings: Settings, needed: float) -> None:
    free = shutil.disk_usage(settings.data_folder).free
    if free < needed:
        raise InputError(
            f"not restored: it may need {needed / 1e9:.1f} GB in {settings.data_folder}, there are "
            f"{free / 1e9:.1f} GB free; free disk space"
        )


def _drill_settings(settings: Settings, folder: Path) -> Settings:
    """Settings of a separate installation in `folder`, with the server's ledger of erasures."""
    apart = Settings(
        **settings.model_dump()
        | {
            "data_folder": folder,
            "shared_folder": None,
            "database_url": f"sqlite:///{folder / 'palpebra.sqlite'}",
            "secret_key": "",
            "s3_bucket": "",
            "audit_syslog": "",
        }
    )
    if ledger_path(settings).is_file():
        shutil.copyfile(ledger_path(settings), ledger_path(apart))
    return apart


def _findings(services: Services) -> Iterator[Finding]:
    yield from database(services)
    yield from counts(services)
    yield from identities(services)


def is_due(last: DrillResult | None, moment: datetime) -> bool:
    """Whether it is time: a week after one that passed, a day after one that did not."""
    if last is None:
        return True
    return moment - last.at >= (EVERY if last.passed else AGAIN_AFTER_FAILURE)


def drill_when_due(settings: Settings) -> DrillResult | None:
    """Make the drill where it is due and nobody else is at it; None where nothing was to do.

    Encrypted backups are left to another machine where this one has no private key.
    """
    address = str(settings.backup_folder)
    backup = newest_backup(backup_store(address, settings), settings.key) if address else None
    if backup is None or (backup.name.endswith(ENDING) and settings.backup_identity is None):
        return None
    try:
        with _drill_lock(settings), _alone_of_all_hosts(settings):
            if not is_due(last_drill(settings), now()):
                return None
            return _drill(settings, backup, identity_of(settings))
    except DrillUnderWayError:
        return None


def identity_of(settings: Settings) -> x25519.Identity | None:
    """The private key that the settings name; None where they name none."""
    return identity_in(settings.backup_identity) if settings.backup_identity else None


def sweep(settings: Settings) -> None:
    """Remove the copy of a drill that was killed: it holds everybody's answers."""
    try:
        with _drill_lock(settings):
            pass
    except DrillUnderWayError:
        pass


@contextmanager
def _alone_of_all_hosts(settings: Settings) -> Iterator[None]:
    """Let one host of a server make the drill that is due."""
    opened = open_database(settings)
    try:
        with open_locks(settings, opened).held("restore drill"):
            yield
    except LockTaken:
        raise DrillUnderWayError("another host is running the drill") from None
    finally:
        opened.close()


@contextmanager
def _drill_lock(settings: Settings) -> Iterator[None]:
    """Hold the lock of the drills, which ends with the process; copies of a killed one go first."""
    with ExitStack() as held:
        try:
            held.enter_context(file_lock(settings.data_folder / "restore-drill.lock", wait=False))
        except BlockingIOError:
            raise DrillUnderWayError("another restore drill is running; wait until it has finished") from None
        for copy in settings.data_folder.glob(f"{COPIES}*"):
            shutil.rmtree(copy, ignore_errors=True)
        yield


# The weekly drill that the server makes by itself, in a separate process at the lowest priority.

LOG = logging.getLogger(__name__)
FIRST_LOOK_S, LOOK_FOR_DRILL_S, STOP_S = 300.0, 3600.0, 10.0


@asynccontextmanager
async def weekly_drill(settings: Settings, first_look_s: float = FIRST_LOOK_S) -> AsyncIterator[None]:
    """Look every hour whether a drill is due while the server runs; nothing where no folder is known."""
    if not settings.backup_folder:
        yield
        return
    await asyncio.to_thread(sweep, settings)
    async with background_task(lambda _: _watch_drills(settings, first_look_s)):
        yield


async def _watch_drills(settings: Settings, first_look_s: float) -> None:
    await asyncio.sleep(first_look_s)
    while True:
        try:
            if is_due(last_drill(settings), now()):
                await _drill_in_a_process()
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("restore drill")
        await asyncio.sleep(LOOK_FOR_DRILL_S)


async def _drill_in_a_process() -> None:
    """Run the command: whatever happens in it, the server goes on."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "server", "drill", "--when-due"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    try:
        said, _ = await process.communicate()
    except asyncio.CancelledError:
        with suppress(ProcessLookupError):
            process.terminate()  # it removes its copy
        with suppress(TimeoutError):
            await asyncio.wait_for(process.communicate(), STOP_S)
            raise
        with suppress(ProcessLookupError):
            process.kill()
        await process.communicate()
        raise
    level = logging.INFO if process.returncode == 0 else logging.ERROR
    LOG.log(level, "restore drill: %s", said.decode("utf-8", "replace").strip())
