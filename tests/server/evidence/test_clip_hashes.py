"""Clips of an object store are hashed before anybody can have answered them."""

import time
from collections import Counter
from collections.abc import Iterator

import pytest

from server.participation.clip_hashes import ClipHashes, clip_hash

CLIPS = {f"{number:064x}": bytes([number]) * 1000 for number in range(30)}


class FarStore:
    """An object store: clips come from elsewhere."""

    def __init__(self) -> None:
        self.reads: Counter[str] = Counter()

    def read(self, sha256: str, begin: int, end: int) -> Iterator[bytes]:
        self.reads[sha256] += 1
        yield CLIPS[sha256][begin:end]


@pytest.fixture
def far() -> FarStore:
    return FarStore()


@pytest.fixture
def clips(far: FarStore) -> Iterator[ClipHashes]:
    opened = ClipHashes(far)  # type: ignore[arg-type]
    yield opened
    opened.close()


def test_all_clips_of_a_version_are_hashed_once_when_tickets_are_issued(
    far: FarStore, clips: ClipHashes
) -> None:
    sizes = [(sha256, len(clip)) for sha256, clip in CLIPS.items()]
    for _ in range(3):
        clips.prepare(1, sizes)
    limit = time.monotonic() + 30
    while sum(far.reads.values()) < len(CLIPS) and time.monotonic() < limit:
        time.sleep(0.01)
    last = sizes[-1]
    while clips.hash_at_once(*last) is None and time.monotonic() < limit:
        time.sleep(0.01)
    assert {sha256: clips.hash_at_once(sha256, size) for sha256, size in sizes} == {
        sha256: clip_hash(clip) for sha256, clip in CLIPS.items()
    }
    assert set(far.reads.values()) == {1}


def test_a_clip_that_is_not_prepared_is_on_its_way_after_the_first_question(clips: ClipHashes) -> None:
    sha256 = next(iter(CLIPS))
    assert clips.hash_at_once(sha256, 1000) is None
    limit = time.monotonic() + 30
    while clips.hash_at_once(sha256, 1000) is None and time.monotonic() < limit:
        time.sleep(0.01)
    assert clips.hash_at_once(sha256, 1000) == clip_hash(CLIPS[sha256])


def test_a_clip_is_read_once(far: FarStore, clips: ClipHashes) -> None:
    sha256, limit = next(iter(CLIPS)), time.monotonic() + 30
    clips.prepare(1, [(sha256, 1000)])
    while clips.hash_at_once(sha256, 1000) is None and time.monotonic() < limit:
        time.sleep(0.01)
    assert clips.hash_at_once(sha256, 1000) == clip_hash(CLIPS[sha256])
    assert far.reads == {sha256: 1}


def test_a_clip_cut_off_by_its_store_has_no_hash(far: FarStore, clips: ClipHashes) -> None:
    sha256 = next(iter(CLIPS))
    clips.prepare(1, [(sha256, 1001)])
    clips.close()
    limit = time.monotonic() + 30
    while clips._fetching and time.monotonic() < limit:
        time.sleep(0.01)
    assert far.reads == {sha256: 1}
    assert sha256 not in clips._hashes


def test_a_clip_is_read_until_the_limit_and_no_longer() -> None:
    class EndlessStore:
        def read(self, sha256: str, begin: int, end: int) -> Iterator[bytes]:
            while True:
                yield b"0"

    clips = ClipHashes(EndlessStore())  # type: ignore[arg-type]
    assert clips.hash_now("0" * 64, 1000, time.monotonic() + 0.05) is None
    clips.close()
