"""The 'photodiode': a separate process that reads the bars at 1 to 2 kHz until its input closes.

    python -m screen_bench.poller FRAMEBUFFER LEFT TOP WIDTH HEIGHT OUTPUT

It writes each change with the time it was seen at, and each time it was held up itself: what happened then is
unknown. Times are CLOCK_MONOTONIC in ms, the clock that browsers count by too.
"""

import ctypes
import gc
import json
import os
import sys
import threading
import time
from functools import cache
from pathlib import Path
from typing import Any

from screen_bench import bars
from screen_bench.framebuffer import ClipArea, FrameBuffer

PAUSE_S = 0.0004
HELD_UP_MS = 2.5
PRIORITY = 60
ROWS = (0.15, 0.85)
LOCK_ALL_MEMORY = 3


def become_real_time() -> bool:
    """Go before every ordinary process, with all memory held; False where that is not allowed."""
    gc.disable()
    ctypes.CDLL(None).mlockall(LOCK_ALL_MEMORY)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return False
    return True


def poll(buffer: FrameBuffer, area: ClipArea, stop: threading.Event) -> dict[str, Any]:
    """Read both rows until `stop`: the changes, the hold-ups and how often was read."""
    upper, lower = (buffer.row(area, share) for share in ROWS)
    read = cache(bars.read)
    changes: list[tuple[float, int, int]] = []
    held_up: list[tuple[float, float]] = []
    last: tuple[int, int] | None = None
    started = before = time.monotonic() * 1000
    polls = 0
    while not stop.is_set():
        state = (read(buffer.values(upper)), read(buffer.values(lower)))
        now = time.monotonic() * 1000
        if now - before > HELD_UP_MS:
            held_up.append((round(before, 2), round(now, 2)))
        if state != last:
            changes.append((round(now, 2), *state))
            last = state
        before, polls = now, polls + 1
        time.sleep(PAUSE_S)
    return {"polls": polls, "seconds": (before - started) / 1000, "changes": changes, "held_up": held_up}


def main() -> None:
    path, left, top, width, height, output = sys.argv[1:]
    area = ClipArea(float(left), float(top), float(width), float(height))
    buffer, stop = FrameBuffer(Path(path)), threading.Event()

    def wait_for_the_end() -> None:
        sys.stdin.read()
        stop.set()

    threading.Thread(target=wait_for_the_end, daemon=True).start()
    real_time = become_real_time()
    print("polling", flush=True)
    log = poll(buffer, area, stop)
    Path(output).write_text(json.dumps(log | {"real_time": real_time}), encoding="utf-8")


if __name__ == "__main__":
    main()
