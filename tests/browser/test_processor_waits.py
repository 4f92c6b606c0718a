"""The kernel's count separates a program that waits for a processor from one that sleeps."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.helpers.processor_waits import ProcessorWaits, run_delay_ms

SPIN = "import os; os.sched_setaffinity(0, {int(os.environ['CPU'])})\nwhile True: pass"
SLEEP = "import time; time.sleep(60)"


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the kernel counts no waits here")
def test_two_programs_on_one_processor_wait_for_each_other_and_a_sleeper_does_not() -> None:
    processor = str(min(os.sched_getaffinity(0)))
    programs = [
        subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"CPU": processor})
        for code in (SPIN, SPIN, SLEEP)
    ]
    try:
        time.sleep(1)
        spinning, other, sleeping = (run_delay_ms(Path(f"/proc/{p.pid}/schedstat")) for p in programs)
    finally:
        for program in programs:
            program.kill()
            program.wait()
    assert min(spinning, other) > 100
    assert sleeping < min(spinning, other)


def test_only_waits_within_the_window_count() -> None:
    waits = ProcessorWaits()
    waits.waits = [(0, 10, 5.0), (10, 20, 40.0), (20, 30, 1.0)]
    assert waits.within(12, 25) == 41
    assert waits.within(31, 40) == 0
