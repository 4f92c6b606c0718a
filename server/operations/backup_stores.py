"""Where backups are kept: a folder or a bucket; sent encrypted to another host, and brought back."""

import re
import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, Protocol, cast

from pyrage import x25519

from experiments.errors import InputError
from experiments.files import whole_private_file
from server.core.db import Database
from server.core.settings import Settings
from server.core.storage import ClipStore, s3_client
from server.core.values import iso, now
from server.operations.backup import ENDING, Description, decrypt, encrypted_stream, write_backup
from server.operations.key_escrow import NAME, content_of_keys, installation
from server.privacy.ledger import LEDGER_NAME, ledger_for_backup

# Where backups are kept: a folder (of another disk or host), or a bucket of an S3-compatible store.

SCHEME = "s3://"
PART_BYTES, PARTS_AT_ONCE = 1 << 24, 2
"""A part of an upload, of which there may be 10,000; and how many are in memory."""
CONNECT_S, READ_S, ATTEMPTS = 10, 60, 4
NAMES = ("palpebra-", (".tar", ".tar.age"))
"""How names of backups begin and end."""


@dataclass(frozen=True)
class Entry:
    """One file of a store.

    Attributes
    ----------
    name : str
    written_at : datetime
    bytes : int
    """

    name: str
    written_at: datetime
    bytes: int


class BackupStore(Protocol):
    """Files by name; a file appears whole or not at all."""

    @property
    def address(self) -> str:
        """As it was given."""

    def entries(self) -> list[Entry]:
        """Its files, oldest first."""

    def put(self, name: str, stream: IO[bytes]) -> None:
        """Store what the stream gives, in place of what had that name."""

    def open(self, name: str) -> AbstractContextManager[IO[bytes]]:
        """A stream of a file."""

    def remove(self, name: str) -> None:
        """Remove a file."""


def backup_store(address: str, settings: Settings) -> BackupStore:
    """The store at an address: `s3://BUCKET/PREFIX`, or a folder.

    Raises
    ------
    InputError
        Neither, or the extra 's3' is not installed.
    """
    if not address.startswith(SCHEME):
        if "://" in address:
            raise InputError(f"expected a folder or s3://BUCKET/PREFIX, got '{address}'")
        return FolderOfBackups(Path(address))
    bucket, _, prefix = address.removeprefix(SCHEME).partition("/")
    if not bucket:
        raise InputError(f"expected s3://BUCKET/PREFIX, got '{address}'")
    client = s3_client(settings, connect_s=CONNECT_S, read_s=READ_S, attempts=ATTEMPTS)
    return BucketOfBackups(client, bucket, f"{prefix.strip('/')}/" if prefix.strip("/") else "")


def backups_in(store: BackupStore) -> list[Entry]:
    """The backups of a store, oldest first; other files are passed over."""
    beginning, ends = NAMES
    return [one for one in store.entries() if one.name.startswith(beginning) and one.name.endswith(ends)]


class FolderOfBackups:
    """A folder, which is made where it is missing; files have mode 600."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.address = str(folder)

    def entries(self) -> list[Entry]:
        """Its files, oldest first; one removed meanwhile is passed over."""
        known = []
        for path in self.folder.glob("*"):
            try:
                said = path.stat()
            except FileNotFoundError:
                continue
            if path.is_file():
                known.append(Entry(path.name, datetime.fromtimestamp(said.st_mtime, UTC), said.st_size))
        return sorted(known, key=lambda entry: (entry.written_at, entry.name))

    def put(self, name: str, stream: IO[bytes]) -> None:
        """Write under a temporary name and rename."""
        path = self.folder / name
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with whole_private_file(path) as target:
                shutil.copyfileobj(stream, target, PART_BYTES)
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error.strerror or error}") from error

    @contextmanager
    def open(self, name: str) -> Iterator[IO[bytes]]:
        """A stream of a file."""
        path = self.folder / name
        try:
            with path.open("rb") as stream:
                yield stream
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror or error}") from error

    def remove(self, name: str) -> None:
        """Remove a file."""
        (self.folder / name).unlink(missing_ok=True)


class BucketOfBackups:
    """Objects of one bucket below a prefix; keep it without versions, or erasures do not reach old keys.

    Parameters
    ----------
    client : Any
        Of boto3 for S3.
    bucket : str
    prefix : str
        Empty, or with a slash at its end.
    """

    def __init__(self, client: Any, bucket: str, prefix: str) -> None:
        self.client, self.bucket, self.prefix = client, bucket, prefix
        self.address = f"{SCHEME}{bucket}/{prefix}".rstrip("/")

    def entries(self) -> list[Entry]:
        """The objects right below the prefix, oldest first."""
        with self._asking():
            pages = self.client.get_paginator("list_objects_v2").paginate(
                Bucket=self.bucket, Prefix=self.prefix, Delimiter="/"
            )
            objects = [one for page in pages for one in page.get("Contents", ())]
        known = [
            Entry(one["Key"].removeprefix(self.prefix), one["LastModified"], int(one["Size"]))
            for one in objects
        ]
        return sorted(known, key=lambda entry: (entry.written_at, entry.name))

    def put(self, name: str, stream: IO[bytes]) -> None:
        """Upload in parts; where the stream fails the parts are removed and nothing appears."""
        from boto3.s3.transfer import TransferConfig

        parts = TransferConfig(multipart_chunksize=PART_BYTES, max_concurrency=PARTS_AT_ONCE)
        with self._asking():
            self.client.upload_fileobj(stream, self.bucket, self.prefix + name, Config=parts)

    @contextmanager
    def open(self, name: str) -> Iterator[IO[bytes]]:
        """A stream of an object."""
        with self._asking():
            answer = self.client.get_object(Bucket=self.bucket, Key=self.prefix + name)
            yield cast(IO[bytes], answer["Body"])

    def remove(self, name: str) -> None:
        """Remove an object."""
        with self._asking():
            self.client.delete_object(Bucket=self.bucket, Key=self.prefix + name)

    @contextmanager
    def _asking(self) -> Iterator[None]:
        from boto3.exceptions import Boto3Error
        from botocore.exceptions import BotoCoreError, ClientError

        try:
            yield
        except (Boto3Error, BotoCoreError, ClientError) as error:
            said = str(error).splitlines()[0]
            raise InputError(
                f"{self.address}: the object store refused the request or did not respond: {said}"
            ) from error


# Backups encrypted into a store of another host, and brought here again.

_INSTALLATION = re.compile(r"-([0-9a-f]{16})\.tar\.age$")


@dataclass(frozen=True)
class StoredBackup:
    """One backup of a store.

    Attributes
    ----------
    store : BackupStore
    name : str
    """

    store: BackupStore
    name: str


# Decision 0742: Backups leave the host as age files.
def back_up_to(
    database: Database,
    settings: Settings,
    clips: ClipStore,
    store: BackupStore,
    name: str,
    recipient: x25519.Recipient,
    *,
    with_clips: bool = True,
) -> tuple[str, Description]:
    """Write an encrypted backup into a store; its name there, and what is in it.

    Key file and ledger of erasures are there before the backup is, and take the place of older ones. Each has
    the installation's fingerprint and its moment in its name: installations that share a store leave one
    another's alone, and a backup that another overtook brings no key back, though none can be read here.

    Parameters
    ----------
    name : str
        Of the file, ending in .tar.

    Raises
    ------
    InputError
        The store cannot be written.
    """
    made: list[Description] = []
    ours = installation(settings.key)

    def write(stream: IO[bytes]) -> None:
        described, keys = write_backup(database, settings, clips, stream, with_clips=with_clips)
        _put_newest(store, _CompanionFile(NAME, ours, keys.written_at), content_of_keys(keys), recipient)
        ledger = _CompanionFile(LEDGER_NAME, ours, iso(now()))
        copy = ledger_for_backup(settings, b"", keys.written_at)
        _put_newest(store, ledger, copy, recipient)
        made.append(described)

    kept_as = f"{name.removesuffix('.tar')}{ending_of(settings.key)}"
    with encrypted_stream(write, recipient) as stream:
        store.put(kept_as, stream)
    return kept_as, made[0]


def ending_of(secret: bytes) -> str:
    """How the names of an installation's encrypted backups end."""
    return f"-{installation(secret)}.tar{ENDING}"


def installation_of(name: str) -> str | None:
    """The fingerprint in the name of an encrypted backup; None where there is none."""
    told = _INSTALLATION.search(name)
    return told[1] if told else None


@dataclass(frozen=True)
class _CompanionFile:
    """What is kept next to encrypted backups, of an installation and a moment."""

    name: str
    installation: str
    moment: str

    def __str__(self) -> str:
        stem, _, suffix = self.name.partition(".")
        return f"{stem}-{self.installation}-{re.sub('[-:]', '', self.moment)}.{suffix}{ENDING}"


def _put_newest(
    store: BackupStore, kept: _CompanionFile, content: bytes, recipient: x25519.Recipient
) -> None:
    """Put a file and remove the older ones; where a newer one is there that one stays."""
    with encrypted_stream(lambda stream: _write(stream, content), recipient) as stream:
        store.put(str(kept), stream)
    there = _files_called(store, kept.name, kept.installation)
    # One of the future is of a clock that was wrong: it would stay for ever.
    present = max(str(kept), str(replace(kept, moment=iso(now()))))
    newest = max(name for name in there if name <= present)
    for name in there:
        if name != newest:
            store.remove(name)


def _files_called(store: BackupStore, name: str, whose: str) -> list[str]:
    """The files of this name, by an installation, or any where it is not known; the newest last."""
    beginning = f"{name.partition('.')[0]}-{whose}"
    named = [entry.name for entry in store.entries() if entry.name.startswith(beginning)]
    return sorted(named, key=lambda one: one.rpartition("-")[2])


def _write(stream: IO[bytes], content: bytes) -> None:
    stream.write(content)


@contextmanager
def brought_here(kept: StoredBackup, folder: Path, identity: x25519.Identity | None) -> Iterator[Path]:
    """The decrypted backup, as a file in `folder` with key file and ledger next to it, removed afterwards.

    Raises
    ------
    InputError
        It is encrypted and no private key was given or it is another; the store does not answer.
    """
    files = [folder / kept.name.removesuffix(ENDING)]
    try:
        _bring_file(kept.store, kept.name, files[0], identity)
        for stored, name in _companion_files(kept):
            files.append(folder / name)
            _bring_file(kept.store, stored, files[-1], identity)
        yield files[0]
    finally:
        for file in files:
            file.unlink(missing_ok=True)


def _companion_files(kept: StoredBackup) -> Iterator[tuple[str, str]]:
    """Key file and ledger of a backup: as they are stored, and their names next to it."""
    whose = installation_of(kept.name) or ""
    for name in (NAME, LEDGER_NAME):
        if kept.name.endswith(ENDING):
            # Where somebody renamed the backup: restore refuses keys that are not its own.
            stored = _files_called(kept.store, name, whose)
        else:
            stored = [entry.name for entry in kept.store.entries() if entry.name == name]
        if stored:
            yield stored[-1], name


def _bring_file(store: BackupStore, name: str, target: Path, identity: x25519.Identity | None) -> None:
    with store.open(name) as source, target.open("wb") as stream:
        target.chmod(0o600)
        if not name.endswith(ENDING):
            while piece := source.read(1 << 20):
                stream.write(piece)
        elif identity is None:
            raise InputError(
                f"{name} is encrypted; specify the file of its private key with --identity or "
                f"PALPEBRA_BACKUP_IDENTITY"
            )
        else:
            decrypt(source, stream, identity, name)
