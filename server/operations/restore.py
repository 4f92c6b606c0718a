"""`server restore`: a backup into an empty database, clip store and data folder."""

import errno
import gzip
import json
import tarfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast

from pydantic import ValidationError
from sqlalchemy import Connection, Table
from sqlalchemy.exc import InterfaceError, OperationalError, StatementError

from experiments.errors import InputError, counted
from server.core.db import Database
from server.core.migrate import alembic_config, derived_anew, known_revision
from server.core.settings import Settings, put_key, secret_key_path
from server.core.storage import ClipStore
from server.operations.backup import CLIPS, DESCRIPTION, KEY, TABLES, Description
from server.operations.key_escrow import NAME, KeyFile, check_fits, key_file, key_file_of, put_back
from server.privacy.erasures import replay
from server.privacy.ledger import (
    LEDGER_NAME,
    add_to_ledger,
    known_from,
    known_until,
    ledger_content,
    ledger_path,
)
from server.privacy.rows import Content, Row, refuse_unless_empty, tables_of, write_rows

FORMAT = 1

ELSEWHERE = (
    "a backup can only be restored into an empty database: set PALPEBRA_DATA_FOLDER to a new folder, or "
    "DATABASE_URL to an empty PostgreSQL database. Restore there, and start the server with the same settings"
)
"""What to do where the database of the settings is in use."""


def restore(
    database: Database,
    settings: Settings,
    clips: ClipStore,
    path: Path,
    told: Callable[[str], None] = lambda _line: None,
    *,
    keys: Path | None = None,
    stale_keys: bool = False,
    despite_erasures: bool = False,
) -> Description:
    """Bring a backup back; afterwards the database has the newest revision.

    The rows go in under the revision they were written by and are migrated from there, all in one
    transaction; counts and hashes are compared with those of the backup. Each clip's hash is checked.

    Parameters
    ----------
    keys : Path, optional
        The key file, next to the backup if None; without one recruiters' IDs are left out.
    stale_keys : bool
        Take one that is older than the backup, though ids of later visits are left out then.
    despite_erasures : bool
        Restore without a ledger of erasures that is newer than the backup, though people who were erased
        since come back.

    Raises
    ------
    InputError
        The file is not a backup, is damaged or from a newer program; the database is not empty; the data
        folder has another secret key; the key file is another installation's or older than the backup; no
        ledger of erasures knows who was erased since the backup.
    """
    copied_ledger = (keys or key_file_of(path)).parent / LEDGER_NAME
    try:
        with tarfile.open(path) as tar:
            described = _description(tar, path)
            key = _content(tar, KEY)
            _check_key(settings, key)
            apart = _key_file(
                described, key, keys or key_file_of(path), named=keys is not None, stale=stale_keys
            )
            covered = _is_covered(settings, copied_ledger, described)
            if not covered and not despite_erasures:
                raise _not_covered(settings, copied_ledger, described)
            _restore_rows(database, tar, described, _Keys(key, apart), told)
            for sha256 in described.clips:
                _restore_clip(clips, tar, sha256)
    except (tarfile.TarError, EOFError, gzip.BadGzipFile) as error:
        raise InputError(f"{path} is damaged or no backup of `server backup`{_reason(error)}") from error
    except OSError as error:
        if error.errno == errno.ENOSPC:
            raise InputError(
                f"not enough disk space for the content of {path}; free disk space and restore again"
            ) from error
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    _keep_key(settings, key)
    _take_over_ledger(settings, copied_ledger)
    told(f"{counted(len(described.clips), 'clip')}, secret key")
    _erase_again(database, settings, told, covered=covered)  # last: it must not be lost among tables
    return described


def _reason(error: Exception) -> str:
    """What the library says; where that is only that no format fits, and a list of them, what to do."""
    (reason, *_) = str(error).splitlines() or [type(error).__name__]
    return "; choose a file that it wrote" if reason.endswith(":") else f": {reason}"


def _is_covered(settings: Settings, copy: Path, described: Description) -> bool:
    """Whether a ledger knows who was erased since the backup: else they would come back unnoticed."""
    if ledger_path(settings).is_file() and known_from(ledger_content(settings)) <= described.created_at:
        return True
    return copy.is_file() and known_until(copy.read_bytes()) > described.created_at


def _not_covered(settings: Settings, copy: Path, described: Description) -> InputError:
    return InputError(
        f"expected a ledger of erasures that is newer than the backup of {described.created_at}, in the data "
        f"folder ({ledger_path(settings)}) or next to the backup ({copy}), got none. Data erased since "
        f"then would come back. Put the newest {LEDGER_NAME} there; if nothing was erased since then, "
        f"restore with --despite-erasures"
    )


def _take_over_ledger(settings: Settings, path: Path) -> None:
    """People erased after the backup are in the copy of the ledger next to it, if it was written since."""
    if path.is_file() and path != ledger_path(settings):
        add_to_ledger(settings, path.read_bytes())


def _erase_again(
    database: Database, settings: Settings, told: Callable[[str], None], *, covered: bool
) -> None:
    path = ledger_path(settings)
    if path.is_file():
        with database.write() as session:
            erased = replay(session, settings)
        told(f"{counted(erased, 'run')} erased again, by {path}")
    if not covered:
        told(
            f"WARNING: no ledger of erasures at {path} is newer than this backup. Data erased since then "
            f"are back. If you find the ledger, put it there and run: server database erase-again"
        )


def _description(tar: tarfile.TarFile, path: Path) -> Description:
    try:
        described = Description.model_validate_json(_content(tar, DESCRIPTION))
    except ValidationError as error:
        raise InputError(f"{path}: {DESCRIPTION} does not belong to a backup") from error
    if described.format != FORMAT or not known_revision(described.revision):
        raise InputError(
            f"{path} was written by version {described.program_version} (revision {described.revision}), "
            "which this program does not support; install that version or a newer one"
        )
    return described


@dataclass(frozen=True)
class _Keys:
    """The secret key, and the keys that backups do not hold; None where their file is missing."""

    secret: bytes
    apart: KeyFile | None


def _key_file(
    described: Description, secret: bytes, path: Path, *, named: bool, stale: bool
) -> KeyFile | None:
    """The key file of a backup; None where it has none and nobody named one."""
    if not described.keys_apart or not (named or path.exists()):
        return None
    keys = key_file(path)
    check_fits(keys, secret, described.created_at, str(path), stale=stale)
    return keys


def _restore_rows(
    database: Database,
    tar: tarfile.TarFile,
    described: Description,
    keys: _Keys,
    told: Callable[[str], None],
) -> None:
    from alembic import command

    with database.write_connection() as connection:
        refuse_unless_empty(connection, "the database", ELSEWHERE)
        with derived_anew(connection):
            command.upgrade(alembic_config(connection), described.revision)
            _write_tables(connection, tar, described, told)
            if described.keys_apart:
                _put_keys_back(connection, keys, told)
            command.upgrade(alembic_config(connection, lambda: keys.secret), "head")


def _write_tables(
    connection: Connection, tar: tarfile.TarFile, described: Description, told: Callable[[str], None]
) -> None:
    known = {table.name: table for table in tables_of(connection)}
    for name in _in_order(known, described):
        expected = described.tables[name]
        written = _write_table(connection, known[name], tar)
        if (written.rows, written.sha256) != (expected.rows, expected.sha256):
            raise InputError(
                f"table {name}: expected {expected.rows} rows, but the file contains {written.rows} or "
                f"different values; the backup is damaged, nothing was restored"
            )
        told(f"{name}: {counted(written.rows, 'row')}")


def _put_keys_back(connection: Connection, keys: _Keys, told: Callable[[str], None]) -> None:
    readable, lost = put_back(connection, keys.secret, keys.apart)
    if keys.apart is None:
        told(
            f"no key file ({NAME}): {lost} recruiters' IDs cannot be read and were omitted. Returning "
            f"participants with such an ID count as new. If you have the file, restore again with --keys FILE"
        )
    elif readable or lost:
        told(f"{readable} recruiters' IDs; the keys of {lost} no longer exist")


def _write_table(connection: Connection, table: Table, tar: tarfile.TarFile) -> Content:
    """Put a table's rows in; what a changed byte made of them is refused as damage, whatever it is."""
    try:
        return write_rows(connection, table, _rows(tar, table.name))
    except (OperationalError, InterfaceError) as error:
        raise InputError(f"the database cannot take the backup: {error.orig}") from error
    except (ValueError, KeyError, TypeError, zlib.error, EOFError, gzip.BadGzipFile, StatementError) as error:
        said = str(getattr(error, "orig", None) or error).splitlines()[0]
        raise InputError(
            f"table {table.name}: the backup is damaged, nothing was restored: {said}"
        ) from error


def _in_order(known: dict[str, Table], described: Description) -> list[str]:
    if unknown := sorted(set(described.tables) - set(known)):
        raise InputError(
            f"the backup contains a table '{unknown[0]}' that its revision does not have; it is damaged, use "
            "another backup"
        )
    return [name for name in known if name in described.tables]


def _rows(tar: tarfile.TarFile, name: str) -> Iterator[Row]:
    with gzip.open(_member(tar, f"{TABLES}{name}.ndjson.gz"), "rt", encoding="utf-8") as stream:
        for line in stream:
            yield json.loads(line)


def _restore_clip(clips: ClipStore, tar: tarfile.TarFile, sha256: str) -> None:
    # The store checks the hash; only names of the form that we wrote are looked for.
    if not (len(sha256) == 64 and PurePosixPath(sha256).name == sha256):
        raise InputError(
            f"the backup names a clip '{sha256[:80]}', which is not a hash; it is damaged, use another backup"
        )
    with _member(tar, f"{CLIPS}{sha256}.mp4") as source:
        clips.add(source, sha256)


def _member(tar: tarfile.TarFile, name: str) -> BinaryIO:
    try:
        member = tar.extractfile(name)
    except KeyError:
        member = None
    if member is None:
        raise InputError(f"{name} is missing from the backup; it is damaged or not from `server backup`")
    return cast(BinaryIO, member)


def _content(tar: tarfile.TarFile, name: str) -> bytes:
    return _member(tar, name).read()


def _check_key(settings: Settings, key: bytes) -> None:
    """Links that were handed out hold with their own key alone."""
    there = settings.secret_key.encode() if settings.secret_key else b""
    path = secret_key_path(settings.data_folder)
    if not there and path.is_file():
        there = path.read_bytes().strip()
    if there and there != key:
        raise InputError(
            "this installation has a different secret key than the backup, so existing links could not be "
            f"shown again. If the key here is not in use, remove {path} (or unset PALPEBRA_SECRET_KEY)"
        )


def _keep_key(settings: Settings, key: bytes) -> None:
    path = secret_key_path(settings.data_folder)
    if not settings.secret_key and not path.is_file():
        put_key(path, key)
