"""Clips to be rendered: all that decides the bytes of one, the hash of that, and workers that render many."""

import hashlib
import json
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from itertools import pairwise
from multiprocessing.connection import wait
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.profile import PROFILE_FPS
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.geometry import AS_BAKED, Movement
from stimuli_builder.clips.life import LIFE_VERSION, draw_life

if TYPE_CHECKING:
    from stimuli_builder.clips.levels import LevelSet

RENDER_VERSION = 2
"""Raise this when the same inputs come to give other pictures; every clip is then built again."""


@dataclass(frozen=True)
class Look:
    """How a clip is rendered, apart from what moves in it.

    `character` is a name or a folder; `beside` the folder it may be relative to. `fingerprint` is the
    SHA-256 of all its pictures, `encoder` names the encoder and its settings, `movement` what of the face
    moves in addition to what those pictures show, `life` how strong the motion between blinks is.
    """

    character: str
    fingerprint: str
    encoder: str
    size_px: tuple[int, int]
    fps: float
    motion_blur: bool
    barcode: bool = False
    beside: Path | None = None
    movement: Movement = AS_BAKED
    life: float = 0.0

    def hashed(self) -> dict[str, Any]:
        """What of it decides a clip's bytes, as JSON data; paths do not count, nor what is not declared."""
        values = asdict(self) | {"beside": None, "character": None}
        if not self.movement.declared:
            del values["movement"]
        if not self.life:
            del values["life"]
        return values

    def levels(self) -> "LevelSet":
        """The character's levels as they move, kept for the next clip."""

        from stimuli_builder.clips.characters import kept_levels

        return kept_levels(self.character, self.fingerprint, self.size_px, self.beside, self.movement)


@dataclass(frozen=True)
class ClipJob:
    """A clip to render."""

    look: Look
    curve: ClipCurve
    life_seed: int = 0

    @property
    def frames(self) -> int:
        """Number of frames of the clip."""
        return int(len(self.curve.closure) * self.look.fps / PROFILE_FPS + 1e-9)

    @property
    def input_hash(self) -> str:
        """SHA-256 over everything that decides the clip's bytes; paths do not count."""
        look = self.look.hashed() | {"render_version": RENDER_VERSION}
        if self.look.life:
            look |= {"life_seed": self.life_seed, "life_version": LIFE_VERSION}
        digest = hashlib.sha256(json.dumps(look, sort_keys=True).encode())
        curve = self.curve
        for name in ("closure", "closure_other", "lower_vertical_mm", "lower_horizontal_mm"):
            values = getattr(curve, name)
            # The name as well: a signal that is absent must not hash like another that has its values.
            digest.update(name.encode())
            if values is not None:
                # Whole millionths: the same on every machine, whatever its last bits of rounding.
                digest.update(np.round(values * 1e6).astype("<i8").tobytes())
        return digest.hexdigest()


def render(job: ClipJob) -> bytes:
    """Render and encode a clip; returns the bytes of its MP4 file."""
    from stimuli_builder.clips.encode import encode_clip
    from stimuli_builder.clips.frames import FramePainter

    look = job.look
    painter = FramePainter(look.levels())
    life = draw_life(len(job.curve.closure), look.life, job.life_seed) if look.life else None
    frames = painter.frames(job.curve, look.fps, look.motion_blur, look.barcode, life)
    return encode_clip(frames, look.size_px, look.fps)


# Rendering jobs on this machine's cores or on a Dask cluster; results are those of one process.

# Which worker renders which job: a worker stays with a character, because reading one takes as long as
# rendering several clips.

WORTH_READING = 32
"""Jobs that must wait elsewhere before a worker reads other levels for them.

Reading takes as long as rendering 5 (a baked face) to 16 clips (the cartoon), and the idle worker takes half
of the waiting jobs.
"""


class JobQueues:
    """One queue per worker, each a run of the sorted jobs; an idle worker takes from the end of the longest.

    Parameters
    ----------
    jobs : sequence of int
        Numbers of the jobs to render, those painted from the same levels one after another.
    levels : sequence
        By the number of a job, what it is painted from; equal for equal levels.
    workers : int
        At most as many as jobs.
    """

    def __init__(self, jobs: Sequence[int], levels: Sequence[Hashable], workers: int) -> None:
        ends = [len(jobs) * worker // workers for worker in range(workers + 1)]
        self._queues = [deque(jobs[start:end]) for start, end in pairwise(ends)]
        self._levels = levels
        self._read: list[Hashable] = [None] * workers

    def take(self, worker: int) -> int | None:
        """The number of the next job of a worker; None where none is left that is worth its while."""
        own, longest = self._queues[worker], max(self._queues, key=len)
        if own:
            job = own.popleft()
        elif longest and (self._levels[longest[-1]] == self._read[worker] or len(longest) > WORTH_READING):
            job = longest.pop()
        else:
            return None
        self._read[worker] = self._levels[job]
        return job


ROUNDS = 4
"""How often a pool that lost a worker is started again before the build gives up."""


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(jobs: Sequence[ClipJob], workers: int, dask: str | None = None) -> Iterator[tuple[int, bytes]]:
    """Yield (index, bytes of the clip) as jobs finish, in any order.

    Jobs of one character follow one another on one worker, so that few workers read it. A worker that
    dies (memory, kill) costs its current clips alone: they are rendered again.

    Parameters
    ----------
    workers : int
        Processes; 1 renders in this one.
    dask : str, optional
        Address of a running Dask scheduler (`tcp://host:8786`) to use instead.
    """
    order = sorted(range(len(jobs)), key=lambda i: (*_levels_of(jobs[i]), i))
    if dask is not None:
        yield from _on_dask(jobs, order, dask)
    elif workers <= 1 or len(jobs) <= 1:
        yield from ((index, render(jobs[index])) for index in order)
    else:
        yield from _on_pool(jobs, order, workers)


def _levels_of(job: ClipJob) -> tuple[str, tuple[int, int], str]:
    """Equal for jobs that are painted from the same levels."""
    return job.look.fingerprint, job.look.size_px, repr(job.look.movement)


def _on_pool(jobs: Sequence[ClipJob], order: list[int], workers: int) -> Iterator[tuple[int, bytes]]:
    left = list(order)
    for _ in range(ROUNDS):
        try:
            for index, content in _one_round(jobs, left, min(workers, len(left))):
                left.remove(index)
                yield index, content
            return
        except BrokenProcessPool:
            continue
    raise InputError(
        f"workers died {ROUNDS} times (out of memory?); {len(left)} clips are left, "
        "try again with --workers 1"
    )


def _one_round(jobs: Sequence[ClipJob], left: list[int], workers: int) -> Iterator[tuple[int, bytes]]:
    queues = JobQueues(left, [_levels_of(job) for job in jobs], workers)
    with ExitStack() as stack:
        pools = [stack.enter_context(_pool_of_one()) for _ in range(workers)]
        running: dict[Future[bytes], tuple[int, int]] = {}

        def hand_out(worker: int) -> None:
            index = queues.take(worker)
            if index is not None:
                running[pools[worker].submit(render, jobs[index])] = worker, index

        # Two each: a worker goes on while its last clip is fetched and written.
        for worker in [*range(workers)] * 2:
            hand_out(worker)
        while running:
            for future in wait_for(running, return_when=FIRST_COMPLETED).done:
                worker, index = running.pop(future)
                content = future.result()
                hand_out(worker)
                yield index, content


@contextmanager
def _pool_of_one() -> Iterator[ProcessPoolExecutor]:
    """A pool whose one worker is known, so that it is given what it has the levels of."""
    # A fresh interpreter: forking a process that already runs threads can lock up.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(1, mp_context=context, initializer=_follow_parent)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _follow_parent() -> None:
    """Interrupts are the parent's to handle; a worker whose parent was killed ends too, with its memory."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def _on_dask(jobs: Sequence[ClipJob], order: list[int], address: str) -> Iterator[tuple[int, bytes]]:
    with _dask_client(address) as (client, completed):
        futures = {client.submit(render, jobs[i], pure=False, retries=ROUNDS): i for i in order}
        for future in completed(list(futures), loop=client.loop):
            index = futures.pop(future)
            content = future.result()
            # Released at once, or the scheduler would hold every clip until the end.
            future.release()
            yield index, content


@contextmanager
def _dask_client(address: str) -> Iterator[tuple[Any, Any]]:
    try:
        import distributed
    except ImportError as error:
        raise InputError("--dask needs the extra 'dask': pip install -e '.[dask]'") from error
    try:
        client = distributed.Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address} ({type(error).__name__}); "
            "start one with `dask scheduler`"
        ) from error
    try:
        yield client, distributed.as_completed
    finally:
        client.close()
