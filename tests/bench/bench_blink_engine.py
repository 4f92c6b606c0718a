"""How fast the blink engine is: an hour at 60 fps at once, and a frame at a time.

Part of `make bench`; alone: pytest tests/bench/bench_blink_engine.py -o python_files='bench_*.py' -s
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from blink_engine import BlinkEngine, perform

FPS, SECONDS = 60.0, 3600.0
FRAMES = round(FPS * SECONDS)
MUST_PER_S = 1e6


def cpu_s(work: Callable[[], object], times: int = 3) -> float:
    """Least processor time of some runs."""
    taken = []
    for _ in range(times):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return min(taken)


def test_an_hour_at_once_and_frame_by_frame(benchmark):
    at_once = cpu_s(lambda: perform(SECONDS, FPS, seed=3, state="speaking"))
    moments = np.arange(FRAMES) / FPS
    baseline = cpu_s(lambda: np.abs(np.sin(moments)) ** 1.19)

    def one_by_one() -> None:
        engine = BlinkEngine(seed=3, state="speaking")
        for time_s in moments[:36_000].tolist():
            engine.frame(time_s)

    frame_us = cpu_s(one_by_one) / 36_000 * 1e6
    sys.stdout.write(
        f"\nblink engine: {FRAMES / at_once / 1e6:.1f} million frames/s at once (must {MUST_PER_S / 1e6:g}), "
        f"{at_once / baseline:.1f} times a sine and a power of as many numbers; {frame_us:.1f} us a frame "
        "one by one\n"
    )
    benchmark.extra_info["times_baseline"] = at_once / baseline
    benchmark.pedantic(lambda: perform(60.0, FPS, seed=3), rounds=5, iterations=1)
