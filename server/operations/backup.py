"""`server backup`: database, clips and secret key of one moment in one file, encrypted where asked."""

import gzip
import io
import json
import os
import tarfile
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import IO

import pyrage
from pydantic import BaseModel, Field
from pyrage import x25519
from sqlalchemy import Connection, Table

from experiments.errors import InputError
from experiments.files import check_targets, whole_private_file
from server.core.db import Database
from server.core.locks import file_lock
from server.core.repository import stored_revision
from server.core.settings import Settings
from server.core.storage import ClipStore
from server.core.values import iso, now
from server.operations import key_escrow
from server.operations.key_escrow import KeyFile
from server.operations.repository import clip_hashes
from server.privacy.ledger import LEDGER_NAME, begin_ledger, ledger_for_backup
from server.privacy.rows import Content, Digest, read_rows, snapshot, tables_of

# `server backup`: database, clips and secret key of one moment in one file.
#
# The file is a tar: `backup.json` (what is in it), `tables/NAME.ndjson.gz` (the rows, of neither database's
# own form, so that a backup of SQLite can be restored to PostgreSQL and back), `clips/SHA256.mp4`,
# `secret_key`. The keys of recruiters' IDs are in a separate file, see `server.operations.key_escrow`.

DESCRIPTION, TABLES, CLIPS, KEY = "backup.json", "tables/", "clips/", "secret_key"
SPOOL_BYTES = 1 << 24


class TableDescription(BaseModel):
    """What a table of the backup holds."""

    rows: int
    sha256: str


class Description(BaseModel):
    """The first file of a backup."""

    format: int = Field(default=1, description="Raised when the form of the file changes.")
    program_version: str
    revision: str = Field(description="Revision of the database the rows were read from.")
    created_at: str = Field(description="The moment of the rows, and of the key file of this backup.")
    tables: dict[str, TableDescription]
    keys_apart: bool = Field(default=False, description="Keys of ids and pseudonyms are in the key file.")
    clips: list[str] = Field(description="SHA-256 of each clip in the file; empty where left out.")


def back_up(
    database: Database,
    settings: Settings,
    clips: ClipStore,
    path: Path,
    *,
    with_clips: bool = True,
    keys: Path | None = None,
) -> Description:
    """Write a backup of one moment while the server goes on; mode 600, under its name only once complete.

    The key file (`keys`, next to the backup if None) and a copy of the ledger of erasures next to that are
    written before the backup has its name: no backup exists without its keys.

    Raises
    ------
    InputError
        A folder is missing, or a file cannot be written or holds the keys of another installation.
    """
    begin_ledger(settings)
    key_path = keys or key_escrow.key_file_of(path)
    check_targets([path, key_path, key_path.parent / LEDGER_NAME])
    key_escrow.check_replaceable(key_path, settings.key)
    with _open_target(path) as stream:
        described, kept = write_backup(database, settings, clips, stream, with_clips=with_clips)
        _write_keys(settings, key_path, kept)
    return described


def _write_keys(settings: Settings, path: Path, kept: KeyFile) -> None:
    """Key file and ledger, by one backup of the installation at a time."""
    with file_lock(settings.common_folder / "backup-keys.lock"):
        key_escrow.check_replaceable(path, settings.key)
        key_escrow.write_keys(path, kept)
        _write_ledger(settings, path.parent / LEDGER_NAME, kept.written_at)


def _write_ledger(settings: Settings, path: Path, moment: str) -> None:
    """A copy of the ledger of erasures next to the key file; what it names already stays."""
    there = path.read_bytes() if path.is_file() else b""
    with whole_private_file(path) as stream:
        stream.write(ledger_for_backup(settings, there, moment))


# Decision 0200: Backups hold rows, not database files.
def write_backup(
    database: Database, settings: Settings, clips: ClipStore, stream: IO[bytes], *, with_clips: bool = True
) -> tuple[Description, KeyFile]:
    """Write a backup of one moment into a stream; return what is in it, and the keys that are not."""
    with tarfile.open(fileobj=stream, mode="w|") as tar:
        with snapshot(database) as connection, tempfile.TemporaryDirectory() as folder:
            described = _describe(connection, clips, Path(folder), with_clips)
            kept = key_escrow.read_keys(connection, settings.key, described.created_at)
            _add_bytes(tar, DESCRIPTION, described.model_dump_json(indent=2).encode())
            for name in described.tables:
                tar.add(Path(folder) / name, TABLES + name + ".ndjson.gz", filter=_without_owner)
        _add_bytes(tar, KEY, settings.key)
        for sha256 in described.clips:
            _add_clip(tar, clips, sha256)
    return described, kept


def _describe(connection: Connection, clips: ClipStore, folder: Path, with_clips: bool) -> Description:
    """Dump every table into `folder` and describe what was dumped."""
    revision = stored_revision(connection)  # the snapshot begins
    moment = iso(now())
    if revision is None:
        raise InputError("the database has no tables yet, so there is nothing to back up")
    dumped = [table for table in tables_of(connection) if table.name != key_escrow.APART]
    tables = {table.name: _dump(connection, table, folder / table.name) for table in dumped}
    hashes = clip_hashes(connection)
    return Description(
        program_version=version("palpebra"),
        revision=revision,
        created_at=moment,
        tables={name: TableDescription(rows=c.rows, sha256=c.sha256) for name, c in tables.items()},
        keys_apart=True,
        clips=[clip for clip in hashes if with_clips and clips.size(clip) is not None],
    )


def _dump(connection: Connection, table: Table, path: Path) -> Content:
    digest = Digest()
    with gzip.open(path, "wt", encoding="utf-8", compresslevel=6) as stream:
        for stored in read_rows(connection, table):
            row = key_escrow.without_key(stored) if table.name == key_escrow.STUDIES else stored
            digest.add(row)
            stream.write(json.dumps(row, ensure_ascii=False) + "\n")
    return digest.content()


def _add_clip(tar: tarfile.TarFile, clips: ClipStore, sha256: str) -> None:
    size = clips.size(sha256)
    if size is None:
        raise InputError(f"clip {sha256[:12]}... was removed during the backup; run the backup again")
    with tempfile.SpooledTemporaryFile(max_size=SPOOL_BYTES) as spool:
        for piece in clips.read(sha256, 0, size):
            spool.write(piece)
        spool.seek(0)
        tar.addfile(_entry(f"{CLIPS}{sha256}.mp4", size), spool)


def _add_bytes(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    tar.addfile(_entry(name, len(content)), io.BytesIO(content))


def _entry(name: str, size: int) -> tarfile.TarInfo:
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode, entry.mtime = size, 0o600, int(now().timestamp())
    return entry


def _without_owner(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """Nothing of the machine's users in the file."""
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = ""
    entry.mode = 0o600
    return entry


@contextmanager
def _open_target(path: Path) -> Iterator[IO[bytes]]:
    # It holds the secret key and everybody's answers: for the owner of the file alone.
    try:
        with whole_private_file(path) as stream:
            yield stream
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from error


# Backups encrypted in the age format (age-encryption.org/v1, X25519).
#
# The server needs the public key alone. `age -d` of any implementation opens them. What is encrypted
# is streamed: nothing in the open is on a disk.

ENDING = ".age"


def recipient_of(text: str) -> x25519.Recipient:
    """The public key of this text; InputError where it is none."""
    try:
        return x25519.Recipient.from_str(text.strip())
    except pyrage.RecipientError as error:
        raise InputError(
            f"expected a public key age1... from `server backup-key`, got '{text[:20]}'"
        ) from error


def identity_in(path: Path) -> x25519.Identity:
    """The private key in a file of `server backup-key` or `age-keygen`; InputError where none is."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as a private key: {error}") from error
    keys = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    try:
        [key] = keys
        return x25519.Identity.from_str(key)
    except (ValueError, pyrage.IdentityError) as error:
        raise InputError(f"{path}: expected one line AGE-SECRET-KEY-... from `server backup-key`") from error


def make_identity(path: Path) -> str:
    """Write a new private key, mode 600, and give its public key; a file that is there is never replaced."""
    if path.exists():
        raise InputError(f"{path} already exists; private keys are never replaced, so choose another file")
    identity = x25519.Identity.generate()
    public = str(identity.to_public())
    with whole_private_file(path) as stream:
        stream.write(f"# public key: {public}\n{identity}\n".encode())
    return public


@contextmanager
def encrypted_stream(write: Callable[[IO[bytes]], None], recipient: x25519.Recipient) -> Iterator[IO[bytes]]:
    """What `write` writes, encrypted, to be read while it is written; its error comes out of the reader.

    Parameters
    ----------
    write : callable
        Given a stream, in a separate thread.
    """
    with (
        _produced_stream(write) as plain,
        _produced_stream(lambda target: pyrage.encrypt_io(plain, target, [recipient])) as sealed,
    ):
        yield sealed


def decrypt(source: IO[bytes], target: IO[bytes], identity: x25519.Identity, name: str) -> None:
    """Write what the source holds in the open.

    Raises
    ------
    InputError
        It was encrypted for another key, is cut short or was changed.
    """
    try:
        pyrage.decrypt_io(source, target, [identity])
    except (pyrage.DecryptError, OSError) as error:
        raise InputError(
            f"{name} cannot be decrypted: damaged, cut short, or encrypted for another key ({error})"
        ) from error


class _Reader:
    """The end of a pipe; there the writer's error is raised, so that nobody takes a part for the whole."""

    def __init__(self, stream: IO[bytes], thread: threading.Thread, errors: list[BaseException]) -> None:
        self._stream, self._thread, self._errors = stream, thread, errors

    def read(self, size: int = -1) -> bytes:
        """At most so many bytes; none at the end."""
        piece = self._stream.read(size)
        if not piece or size < 0:
            self._thread.join()
            if self._errors:
                raise self._errors[0]
        return piece

    def close(self) -> None:
        """Close it: the writer notices at its next write."""
        self._stream.close()


@contextmanager
def _produced_stream(write: Callable[[IO[bytes]], None]) -> Iterator[IO[bytes]]:
    outlet, inlet = os.pipe()
    errors: list[BaseException] = []

    def run() -> None:
        try:
            with os.fdopen(inlet, "wb") as stream:
                try:
                    write(stream)
                except BaseException as error:
                    errors.append(error)  # before the reader sees the end
                    raise
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run, daemon=True)
    reader = _Reader(os.fdopen(outlet, "rb"), thread, errors)
    thread.start()
    try:
        yield reader  # type: ignore[misc]
    except BaseException as error:
        if errors and not isinstance(errors[0], BrokenPipeError):
            raise errors[0] from error
        raise
    finally:
        with suppress(OSError):
            reader.close()
        thread.join()
