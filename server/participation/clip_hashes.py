"""Hashes of clips, to check digests against: from a folder at once, from an object store when they come."""

import hashlib
import hmac
import math
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Lock

from server.core.storage import ClipStore, FolderStore

MAX_CLIP_BYTES = 32 << 20
"""Larger clips are hashed in the background: a rating does not wait so long."""

MAX_HASHES = 200_000


def clip_hash(clip: bytes) -> bytes:
    """SHA-512 of a clip: nobody can know it without the clip's bytes, and each clip needs it only once."""
    return hashlib.sha512(clip).digest()


def clip_digest(ticket: str, *hashes: bytes) -> str:
    """The digest that shows that the clips of these hashes were there when the ticket was used.

    64 hexadecimal digits of HMAC-SHA-256(ticket, SHA-512(first clip) || SHA-512(second clip) ...).
    """
    return hmac.digest(ticket.encode(), b"".join(hashes), "sha256").hex()


class ClipHashes:
    """The hashes of the clips asked for; safe to use from several threads."""

    def __init__(self, store: ClipStore) -> None:
        self._store = store
        self._local = isinstance(store, FolderStore)
        self._hashes: dict[str, bytes] = {}
        self._lock = Lock()
        self._fetching: set[str] = set()
        self._prepared: set[int] = set()
        self._pool: ThreadPoolExecutor | None = None

    def hash_at_once(self, sha256: str, size: int) -> bytes | None:
        """The `clip_hash` of a clip where it can be had without waiting; None: it is on its way."""
        if sha256 not in self._hashes:
            if not self._local or size > MAX_CLIP_BYTES:
                return self._hash_in_background(sha256, size)
            self._hash_in_pieces(sha256, size)
        return self._hashes.get(sha256)

    def hash_now(self, sha256: str, size: int, limit: float) -> bytes | None:
        """The `clip_hash` of a clip, read for it where it must be; None where it cannot be read whole.

        It is read until `limit` by the monotonic clock.
        """
        if sha256 not in self._hashes:
            self._hash_in_pieces(sha256, size, limit)
        return self._hashes.get(sha256)

    def prepare(self, version: int, clips: Iterable[tuple[str, int]]) -> None:
        """Hash the clips of a study's version, hash and size of each, before they are answered.

        Once a version and process: all where clips lie in an object store, of a folder those that are large.
        """
        with self._lock:
            if version in self._prepared:
                return
            self._prepared.add(version)
        for sha256, size in clips:
            if not self._local or size > MAX_CLIP_BYTES:
                self.hash_at_once(sha256, size)

    def _hash_in_pieces(self, sha256: str, size: int, limit: float = math.inf) -> None:
        """Read a clip and keep its hash; nothing where it cannot be read whole by `limit`."""
        hashed, length = hashlib.sha512(), 0
        try:
            for piece in self._store.read(sha256, 0, size):
                if time.monotonic() > limit:
                    return
                hashed.update(piece)
                length += len(piece)
        except Exception:
            # Nothing is kept: the next answer that needs this clip asks again.
            return
        with self._lock:
            # A clip that was read in part has another hash.
            if length == size and len(self._hashes) < MAX_HASHES:
                self._hashes[sha256] = hashed.digest()

    def _hash_in_background(self, sha256: str, size: int) -> bytes | None:
        """Hash a clip in the one thread for it, once; its hash where it has come since it was looked for."""
        with self._lock:
            if sha256 in self._fetching or sha256 in self._hashes:
                return self._hashes.get(sha256)
            self._fetching.add(sha256)
            if self._pool is None:
                self._pool = ThreadPoolExecutor(1, "palpebra-clips")

        def run() -> None:
            try:
                self._hash_in_pieces(sha256, size)
            finally:
                with self._lock:
                    self._fetching.discard(sha256)

        self._pool.submit(run)
        return None

    def close(self) -> None:
        """Fetch nothing more."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
