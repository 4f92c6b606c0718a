"""Rendering by one process, by two, and on a Dask cluster of two: how much faster, and the same bytes?

`make bench`, or: PYTHONPATH=. python tests/bench/bench_workers.py [--clips 40]
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable

from experiments.load import load_experiment
from stimuli_builder.clips.design_clips import Options, planned_clips
from stimuli_builder.clips.jobs import ClipJob, render
from stimuli_builder.clips.workers import run_jobs

CLIPS, WORKERS = 40, 2
Result = Iterable[tuple[int, bytes]]


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def some_jobs(count: int) -> list[ClipJob]:
    """Clips spread over Experiment 3."""
    jobs = [clip.job for clip in planned_clips(load_experiment("exp3"), Options())]
    return jobs[:: max(1, len(jobs) // count)][:count]


def timed(work: Callable[[], Result]) -> tuple[dict[int, bytes], float]:
    """What it gives, and the seconds it took."""
    began = time.perf_counter()
    found = dict(work())
    return found, time.perf_counter() - began


def on_dask(jobs: list[ClipJob]) -> tuple[dict[int, bytes], float] | None:
    """On a cluster of two processes that runs already, as `--dask` finds it; None without the extra."""
    try:
        from distributed import LocalCluster
    except ImportError:
        return None
    with LocalCluster(
        n_workers=WORKERS, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as cluster:
        return timed(lambda: run_jobs(jobs, 1, cluster.scheduler_address))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", type=int, default=CLIPS, help=f"how many clips ({CLIPS})")
    jobs = some_jobs(parser.parse_args().clips)
    render(jobs[0])  # what is compiled and read once, is so now
    say(f"{len(jobs)} clips of exp3, {os.cpu_count()} cores, load before: {os.getloadavg()[0]:.1f}")
    before = time.process_time()
    alone, one_s = timed(lambda: run_jobs(jobs, 1))
    say(f"one process          {one_s:6.1f} s, {time.process_time() - before:.1f} s of processor time")
    others = {f"--workers {WORKERS}": timed(lambda: run_jobs(jobs, WORKERS)), "--dask": on_dask(jobs)}
    same = True
    for name, found in others.items():
        if found is None:
            say(f"{name:20} skipped: the extra 'dask' is not installed")
            continue
        same = same and found[0] == alone
        verdict = "the same bytes" if found[0] == alone else "OTHER BYTES"
        say(f"{name:20} {found[1]:6.1f} s, {one_s / found[1]:.2f} times as fast, {verdict}")
    say("starting the two processes is included, starting the cluster is not")
    return int(not same)


if __name__ == "__main__":
    sys.exit(main())
