"""Clips in memory, to check digests against: from a folder at once, from an object store when they come."""

import hashlib
import hmac
import math
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Lock

from server.core.storage import ClipStore, FolderStore

MAX_KEPT_BYTES = 64 << 20
MAX_CLIP_BYTES = 32 << 20
"""Larger clips are hashed piece by piece in the background: a rating does not wait so long."""

MAX_HASHES = 200_000


def clip_hash(clip: bytes) -> bytes:
    """SHA-512 of a clip: nothing tells it to who has not its bytes, and each clip needs it but once."""
    return hashlib.sha512(clip).digest()


def clip_digest(ticket: str, *hashes: bytes) -> str:
    """The digest that shows that the clips of these hashes were there when the ticket was used.

    64 hexadecimal digits of HMAC-SHA-256(ticket, SHA-512(first clip) || SHA-512(second clip) ...).
    """
    return hmac.digest(ticket.encode(), b"".join(hashes), "sha256").hex()


def older_digest(ticket: str, clips: bytes) -> str:
    """As pages make it that were open before: of the clips' bytes themselves, which takes longer."""
    return hmac.digest(ticket.encode(), clips, "sha256").hex()


class ClipBytes:
    """The clips last asked for, up to `MAX_KEPT_BYTES`; safe to use from several threads."""

    def __init__(self, store: ClipStore) -> None:
        self._store = store
        self._local = isinstance(store, FolderStore)
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._bytes = 0
        self._hashes: dict[str, bytes] = {}
        self._lock = Lock()
        self._fetching: set[str] = set()
        self._prepared: set[int] = set()
        self._pool: ThreadPoolExecutor | None = None

    def at_once(self, sha256: str, size: int) -> bytes | None:
        """The clip where it can be had without waiting; None: it is on its way, or too large."""
        kept = self._in_memory(sha256)
        if kept is not None or size > MAX_CLIP_BYTES:
            return kept
        if self._local:
            return self._read(sha256, size)
        return self._fetch(sha256, size)

    def hash_at_once(self, sha256: str, size: int) -> bytes | None:
        """The `clip_hash` of a clip where it can be had without waiting."""
        known = self._hashes.get(sha256)
        if known is not None:
            return known
        if size > MAX_CLIP_BYTES:
            self._in_background(sha256, size, self._hash_in_pieces)
            return None
        return None if self.at_once(sha256, size) is None else self._hashes.get(sha256)

    def hash_now(self, sha256: str, size: int, limit: float) -> bytes | None:
        """The `clip_hash` of a clip, read for it where it must be; None where it cannot be read whole.

        It is read until `limit` by the monotonic clock.
        """
        if sha256 not in self._hashes:
            self._hash_in_pieces(sha256, size, limit)
        return self._hashes.get(sha256)

    def feed(self, sha256: str, size: int, take: Callable[[bytes], object], limit: float = math.inf) -> bool:
        """Give a clip to `take` piece by piece; False where it could not be read whole by `limit`."""
        length = 0
        try:
            for piece in self._store.read(sha256, 0, size):
                if time.monotonic() > limit:
                    return False
                take(piece)
                length += len(piece)
        except Exception:
            return False
        return length == size

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

    def _in_memory(self, sha256: str) -> bytes | None:
        with self._lock:
            kept = self._kept.get(sha256)
            if kept is not None:
                self._kept.move_to_end(sha256)
            return kept

    def _read(self, sha256: str, size: int) -> bytes | None:
        try:
            clip = b"".join(self._store.read(sha256, 0, size))
        except Exception:
            return None
        if len(clip) != size:
            return None
        self._keep(sha256, clip)
        return clip

    def _keep(self, sha256: str, clip: bytes) -> None:
        hashed = clip_hash(clip)
        with self._lock:
            if len(self._hashes) < MAX_HASHES:
                self._hashes[sha256] = hashed
            if sha256 not in self._kept:
                self._kept[sha256] = clip
                self._bytes += len(clip)
            while self._bytes > MAX_KEPT_BYTES:
                self._bytes -= len(self._kept.popitem(last=False)[1])

    def _fetch(self, sha256: str, size: int) -> bytes | None:
        """The clip where it has come since memory was looked at; otherwise it is on its way."""
        if not self._in_background(sha256, size, self._read):
            with self._lock:
                return self._kept.get(sha256)
        return None

    def _hash_in_pieces(self, sha256: str, size: int, limit: float = math.inf) -> None:
        """Hash a clip that is too large for the memory; nothing where it cannot be read whole."""
        hashed = hashlib.sha512()
        is_whole = self.feed(sha256, size, hashed.update, limit)
        with self._lock:
            if is_whole and len(self._hashes) < MAX_HASHES:
                self._hashes[sha256] = hashed.digest()

    def _in_background(self, sha256: str, size: int, make: Callable[[str, int], object]) -> bool:
        """Make something of a clip in the one thread for it; False where it is in memory or on its way."""
        with self._lock:
            if sha256 in self._fetching or sha256 in self._kept:
                return False
            self._fetching.add(sha256)
            if self._pool is None:
                self._pool = ThreadPoolExecutor(1, "palpebra-clips")

        def run() -> None:
            try:
                make(sha256, size)
            finally:
                with self._lock:
                    self._fetching.discard(sha256)

        self._pool.submit(run)
        return True

    def close(self) -> None:
        """Fetch nothing more."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
