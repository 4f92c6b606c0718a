"""Where clip bytes lie: named by their SHA-256, written once, never changed."""

import hashlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Protocol

from experiments.errors import InputError
from server.errors import ApiError

CHUNK_BYTES = 1 << 20


class ClipsAway(ApiError):
    """The object store does not answer; pages try again."""

    status = 503
    code = "clips_away"


class ClipStore(Protocol):
    """What a clip store does: the folder here, an object store in `server.storage.s3`."""

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
