"""Rendering clips: memory of one process, and how much faster several processes are.

    python -m bench.rendering memory 1920x720
    python -m bench.rendering performance
    python -m bench.rendering workers [--clips 40]

memory: one process renders clips of both characters in turn: the most a build's worker ever holds.
performance: the peak of a clip of 60 s and of one of 5 s, each in a separate process; with a character and
seconds it renders that one.
workers: by one process, by two, and on a Dask cluster of two: how much faster, and the same bytes?
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace

from bench.harness import run_part, say
from experiments.declaration.rendering import RenderSettings
from experiments.load import load_experiment
from stimuli_builder.clips.cli_clip import parse_size
from stimuli_builder.clips.design_clips import Options, look_of, performance_curve, planned_clips
from stimuli_builder.clips.jobs import ClipJob, render, run_jobs

# Every so manyth clip: one of each character of Exp 1, and of Exp 3 one of each way the lower lid moves.
STEPS = {"exp1": 160, "exp3": 20}


def clip_memory() -> None:
    size = parse_size(sys.argv[1] if len(sys.argv) > 1 else "960x360")
    jobs = [
        clip.job
        for name, step in STEPS.items()
        for clip in planned_clips(load_experiment(name), Options())[::step]
    ]
    for job in jobs:
        render(replace(job, look=replace(job.look, size_px=size)))
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    sys.stdout.write(f"{size[0]} x {size[1]} px, {len(jobs)} clips: {peak_gb:.2f} GB at most (must 1.5)\n")


LENGTHS_S = (5.0, 60.0)
CHARACTERS = ("cartoon", "alder@8")


def peak_mb(character: str, seconds: float) -> float:
    """Peak resident memory of a new process that renders one clip of 960 x 360 px, in MB."""
    command = [sys.executable, "-m", "bench.rendering", "performance", character, f"{seconds:g}"]
    return float(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


def rendered_mb(character: str, seconds: float) -> float:
    """Render a clip here; this process's peak resident memory, in MB."""
    settings = RenderSettings(character=character, performance="intervals", seconds=seconds)
    curve = performance_curve(settings, "", 1, 2011)
    render(ClipJob(look_of(settings, Options()), curve))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def performance_memory() -> None:
    if len(sys.argv) > 2:
        sys.stdout.write(f"{rendered_mb(sys.argv[1], float(sys.argv[2])):.1f}")
        return
    for character in CHARACTERS:
        short, long = (peak_mb(character, seconds) for seconds in LENGTHS_S)
        sys.stdout.write(
            f"{character}: {short:.0f} MB for {LENGTHS_S[0]:g} s, {long:.0f} MB for {LENGTHS_S[1]:g} s, "
            f"ratio {long / short:.3f} (must 1.05)\n"
        )


CLIPS, WORKERS = 40, 2
Result = Iterable[tuple[int, bytes]]


def some_jobs(count: int) -> list[ClipJob]:
    """Clips spread over Experiment 3."""
    jobs = [clip.job for clip in planned_clips(load_experiment("exp3"), Options())]
    return jobs[:: max(1, len(jobs) // count)][:count]


def timed(work: Callable[[], Result]) -> tuple[dict[int, bytes], float]:
    """What it gives, and the seconds it took."""
    began = time.perf_counter()
    result = dict(work())
    return result, time.perf_counter() - began


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


def compare_workers() -> int:
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
    for name, result in others.items():
        if result is None:
            say(f"{name:20} skipped: the extra 'dask' is not installed")
            continue
        same = same and result[0] == alone
        verdict = "the same bytes" if result[0] == alone else "OTHER BYTES"
        say(f"{name:20} {result[1]:6.1f} s, {one_s / result[1]:.2f} times as fast, {verdict}")
    say("starting the two processes is included, starting the cluster is not")
    return int(not same)


PARTS = {
    "memory": clip_memory,
    "performance": performance_memory,
    "workers": compare_workers,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
