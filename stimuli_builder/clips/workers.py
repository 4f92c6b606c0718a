"""Rendering jobs on this machine's cores or on a Dask cluster; results are those of one process."""

import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from threading import Thread
from typing import Any

from experiments.errors import InputError
from stimuli_builder.clips.jobs import ClipJob, render

ROUNDS = 4
"""How often a pool that lost a worker is started again before the build gives up."""


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(jobs: Sequence[ClipJob], workers: int, dask: str | None = None) -> Iterator[tuple[int, bytes]]:
    """Yield (index, bytes of the clip) as jobs finish, in any order.

    Jobs of one character follow one another, so that a worker decodes each character once. A worker that
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
            for index, content in _one_pool(jobs, left, min(workers, len(left))):
                left.remove(index)
                yield index, content
            return
        except BrokenProcessPool:
            continue
    raise InputError(
        f"workers died {ROUNDS} times (out of memory?); {len(left)} clips are left, "
        "try again with --workers 1"
    )


def _one_pool(jobs: Sequence[ClipJob], left: list[int], workers: int) -> Iterator[tuple[int, bytes]]:
    # A fresh interpreter: forking a process that already runs threads can lock up.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_follow_parent)
    try:
        futures: dict[Future[bytes], int] = {pool.submit(render, jobs[index]): index for index in left}
        for future in as_completed(list(futures)):
            yield futures.pop(future), future.result()
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
