"""Where backups are kept: a folder (of another disk or host), or a bucket of an S3-compatible store."""

import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, Protocol, cast

from experiments.errors import InputError
from experiments.files import whole_private_file
from server.settings import Settings
from server.storage.s3 import s3_client

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
        """Write beside the name and rename."""
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
            raise InputError(f"{self.address}: the object store refused or did not answer: {said}") from error
