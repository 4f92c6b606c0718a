"""Where the bytes of clips lie, a folder or an S3-compatible store, and who may read the data folder."""

import hashlib
import logging
import os
import secrets
import stat
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Protocol
from urllib.parse import urlsplit

from experiments.errors import InputError
from server.core.errors import ApiError
from server.core.settings import Settings

# Where clip bytes lie: named by their SHA-256, written once, never changed.

CHUNK_BYTES = 1 << 20


class ClipsAway(ApiError, status=503, code="clips_away"):
    """The object store does not answer; pages try again."""


class ClipStore(Protocol):
    """What a clip store does: the folder here, an object store in `server.core.storage`."""

    def add(self, source: BinaryIO, sha256: str) -> bool:
        """Store a clip; True where it was not there yet. InputError where the bytes have another hash."""

    def adopt(self, path: Path, sha256: str) -> None:
        """Store a whole file that has this hash and is never changed; it may be shared with its folder."""

    def size(self, sha256: str) -> int | None:
        """Length in bytes; None where there is no such clip."""

    def read(self, sha256: str, start: int, end: int) -> Iterator[bytes]:
        """Bytes from `start` up to but without `end`, in pieces."""

    def remove(self, sha256: str) -> None:
        """Delete a clip; nothing happens where it is not there."""

    def problem(self, sha256: str | None) -> str | None:
        """What keeps clips from being read now; `sha256` is one that should be there, None where none is."""

    def address(self, sha256: str) -> str | None:
        """Where a browser may fetch the clip itself; None: from this server."""

    def origin(self) -> str | None:
        """Scheme and host of such addresses; None: this server's."""


class FolderStore:
    """Clips in a folder, in sub-folders by the first two digits of the hash."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, sha256: str) -> Path:
        """Where the clip lies or would lie."""
        return self.folder / sha256[:2] / f"{sha256}.mp4"

    def add(self, source: BinaryIO, sha256: str) -> bool:
        """Copy to a temporary name, check the hash, then rename: no half clip is ever visible."""
        final = self.path(sha256)
        if final.is_file():
            return False
        final.parent.mkdir(parents=True, exist_ok=True)
        temporary = final.with_name(f".{sha256[:16]}.{secrets.token_hex(4)}")
        try:
            digest = _copy(source, temporary)
            if digest != sha256:
                raise InputError(
                    f"clip: expected sha256 {sha256[:12]}..., got {digest[:12]}...; the file was changed"
                )
            temporary.replace(final)
        finally:
            temporary.unlink(missing_ok=True)
        return True

    def adopt(self, path: Path, sha256: str) -> None:
        """Link to the file, which takes no room and no time; copy it where it lies on another disk."""
        final = self.path(sha256)
        if final.is_file():
            return
        final.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(path, final)
        except FileExistsError:
            return
        except OSError:
            with path.open("rb") as stream:
                self.add(stream, sha256)

    def size(self, sha256: str) -> int | None:
        """Length in bytes; None where there is no such clip."""
        try:
            return self.path(sha256).stat().st_size
        except FileNotFoundError:
            return None

    def read(self, sha256: str, start: int, end: int) -> Iterator[bytes]:
        """Bytes from `start` up to but without `end`, in pieces of at most a mebibyte."""
        with self.path(sha256).open("rb") as stream:
            stream.seek(start)
            while start < end:
                piece = stream.read(min(CHUNK_BYTES, end - start))
                if not piece:
                    return
                start += len(piece)
                yield piece

    def remove(self, sha256: str) -> None:
        """Delete a clip; nothing happens where it is not there."""
        self.path(sha256).unlink(missing_ok=True)

    def problem(self, sha256: str | None) -> str | None:
        """What keeps clips from being read now; a folder is made with the first clip."""
        if sha256 is None:
            return None
        try:
            self.path(sha256).open("rb").close()
        except OSError as error:
            return f"{self.path(sha256)}: {error.strerror}"
        return None

    def address(self, sha256: str) -> str | None:  # noqa: ARG002 - as other stores have it
        """Clips of a folder come from this server."""
        return None

    def origin(self) -> str | None:
        """Clips of a folder come from this server."""
        return None


def _copy(source: BinaryIO, target: Path) -> str:
    digest = hashlib.sha256()
    with target.open("wb") as stream:
        while piece := source.read(CHUNK_BYTES):
            digest.update(piece)
            stream.write(piece)
        stream.flush()
        os.fsync(stream.fileno())
    return digest.hexdigest()


# Clips in an S3-compatible object store, passed on by the server or fetched by browsers themselves.

log = logging.getLogger("palpebra")
PRESIGNED_S = 3600
CONNECT_S, READ_S = 2, 3
AWAY_S = 5.0
"""A store that gave no answer is left alone for so long: requests are refused at once."""
AT_ONCE = 12
"""Questions to the store under way: threads a hanging store may hold of the forty that serve."""
SPOOL_BYTES = 1 << 24
AWAY = "The store of the clips does not answer; please try again."
IMMUTABLE = "public, max-age=31536000, immutable"


class S3Store:
    """Clips as objects `PREFIX/SHA256.mp4` of one bucket.

    Parameters
    ----------
    client : Any
        Of boto3 for S3.
    presigned : bool, optional
        Whether browsers fetch clips from the store by signed URLs.
    """

    def __init__(self, client: Any, bucket: str, prefix: str = "", *, presigned: bool = False) -> None:
        self.client, self.bucket, self.presigned = client, bucket, presigned
        self.prefix = f"{prefix.strip('/')}/" if prefix.strip("/") else ""
        self._sizes: dict[str, int] = {}
        self._away_until = 0.0
        self._free = threading.BoundedSemaphore(AT_ONCE)

    def add(self, source: BinaryIO, sha256: str) -> bool:
        """Check the hash of a local copy, then upload: an object appears whole or not at all."""
        if self.size(sha256) is not None:
            return False
        hashed = hashlib.sha256()
        with tempfile.SpooledTemporaryFile(max_size=SPOOL_BYTES) as spool:
            while piece := source.read(CHUNK_BYTES):
                hashed.update(piece)
                spool.write(piece)
            if (digest := hashed.hexdigest()) != sha256:
                raise InputError(
                    f"clip: expected sha256 {sha256[:12]}..., got {digest[:12]}...; the file was changed"
                )
            spool.seek(0)
            said = {"ContentType": "video/mp4", "CacheControl": IMMUTABLE}
            self.client.upload_fileobj(spool, self.bucket, self._name(sha256), ExtraArgs=said)
        return True

    def adopt(self, path: Path, sha256: str) -> None:
        """Upload the file."""
        with path.open("rb") as stream:
            self.add(stream, sha256)

    def size(self, sha256: str) -> int | None:
        """Length in bytes; None where there is no such clip. It never changes, so it is asked for once."""
        if sha256 not in self._sizes:
            try:
                answer = self._answer(self.client.head_object, Key=self._name(sha256))
            except self.client.exceptions.ClientError as error:
                if error.response["ResponseMetadata"]["HTTPStatusCode"] == 404:
                    return None
                raise
            self._sizes[sha256] = int(answer["ContentLength"])
        return self._sizes[sha256]

    def read(self, sha256: str, start: int, end: int) -> Iterator[bytes]:
        """Bytes from `start` up to but without `end`, in pieces of at most a mebibyte."""
        if start >= end:
            return
        part = f"bytes={start}-{end - 1}"
        answer = self._answer(self.client.get_object, Key=self._name(sha256), Range=part)
        with self._asking():
            yield from answer["Body"].iter_chunks(CHUNK_BYTES)

    def remove(self, sha256: str) -> None:
        """Delete a clip; nothing happens where it is not there."""
        self._sizes.pop(sha256, None)
        self.client.delete_object(Bucket=self.bucket, Key=self._name(sha256))

    def problem(self, sha256: str | None) -> str | None:
        """What keeps clips from being read now: the store is asked each time."""
        from botocore.exceptions import BotoCoreError, ClientError

        try:
            if sha256 is None:
                self._answer(self.client.head_bucket)
            else:
                self._answer(self.client.head_object, Key=self._name(sha256))
        except (BotoCoreError, ClientError, ClipsAway) as error:
            return f"bucket {self.bucket}: {error}"
        return None

    def address(self, sha256: str) -> str | None:
        """A signed URL good for an hour, where browsers are to fetch clips from the store."""
        if not self.presigned:
            return None
        what = {"Bucket": self.bucket, "Key": self._name(sha256)}
        return str(self.client.generate_presigned_url("get_object", Params=what, ExpiresIn=PRESIGNED_S))

    def origin(self) -> str | None:
        """Scheme and host of the signed URLs, for the content security policy."""
        address = self.address("0" * 64)
        return f"{urlsplit(address).scheme}://{urlsplit(address).netloc}" if address else None

    def _answer(self, ask: Callable[..., Any], **what: str) -> Any:
        """What the store answers; ClipsAway where no answer comes."""
        with self._asking():
            return ask(Bucket=self.bucket, **what)

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """ClipsAway where the store does not answer, did not lately, or has kept too many waiting."""
        from botocore.exceptions import ConnectionError as NoConnection
        from botocore.exceptions import HTTPClientError

        if time.monotonic() < self._away_until or not self._free.acquire(blocking=False):
            raise ClipsAway(AWAY, headers={"retry-after": "5"})
        try:
            yield
        except (NoConnection, HTTPClientError) as error:
            self._away_until = time.monotonic() + AWAY_S
            log.error("the object store is away: %s", type(error).__name__)
            raise ClipsAway(AWAY, headers={"retry-after": "5"}) from error
        finally:
            self._free.release()

    def _name(self, sha256: str) -> str:
        return f"{self.prefix}{sha256}.mp4"


def open_s3(settings: Settings) -> S3Store:
    """The store of these settings."""
    # A store that hangs must not hold the threads that all other requests need.
    client = s3_client(settings, connect_s=CONNECT_S, read_s=READ_S, attempts=1)
    return S3Store(client, settings.s3_bucket, settings.s3_prefix, presigned=settings.s3_presigned)


def s3_client(settings: Settings, *, connect_s: float, read_s: float, attempts: int) -> Any:
    """A client of the object store; credentials are found by boto3's own rules (AWS_ACCESS_KEY_ID...)."""
    try:
        import boto3
        from botocore.config import Config
    except ImportError as error:
        raise InputError("an object store needs the extra 's3': pip install -e '.[s3]'") from error
    style = "path" if settings.s3_endpoint else "virtual"
    return boto3.client(
        "s3",
        endpoint_url=settings.s3_endpoint or None,
        region_name=settings.s3_region,
        config=Config(
            s3={"addressing_style": style},
            signature_version="s3v4",
            retries={"total_max_attempts": attempts, "mode": "standard"},
            connect_timeout=connect_s,
            read_timeout=read_s,
        ),
    )


# Where a clip is, no matter who asks: pages know it from the clip's hash.


def clip_address(sha256: str) -> str:
    """The path of a clip's bytes on this server."""
    return f"/clips/{sha256}.mp4"


# Who may read the data folder: its owner alone.

OTHERS = 0o077
"""The rights of group and everybody."""


def own_folders(settings: Settings) -> list[Path]:
    """The folders that a server keeps things in: its own, and the one its hosts share."""
    return list(dict.fromkeys((settings.data_folder, settings.common_folder)))


def open_to_others(folder: Path) -> Iterator[Path]:
    """The folder and everything in it that others than its owner have a right to; links are not followed."""
    if folder.is_dir() and _is_open(folder):
        yield folder
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent, name)
            if not path.is_symlink() and _is_open(path):
                yield path


def _is_open(path: Path) -> bool:
    try:
        return bool(stat.S_IMODE(path.lstat().st_mode) & OTHERS)
    except FileNotFoundError:  # a temporary file that has gone meanwhile
        return False


def close_to_others(settings: Settings) -> None:
    """Take from others what an older version, or another program, left open to them.

    Files of other users stay unchanged; the doctor reports them.
    """
    for path in (one for folder in own_folders(settings) for one in open_to_others(folder)):
        try:
            path.chmod(stat.S_IMODE(path.lstat().st_mode) & ~OTHERS)
        except OSError:
            continue
