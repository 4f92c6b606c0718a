"""What else the computer does while a clip plays."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

from screen_bench.browser import Browser

HOGS = 4
# Either ends with the bench, which may be killed.
HOG = """
import os
bench = os.getppid()
while os.getppid() == bench:
    pass
"""
WRITER = """
import os, sys, tempfile
bench = os.getppid()
block = os.urandom(1 << 20)
with tempfile.TemporaryFile(dir=sys.argv[1]) as file:
    while os.getppid() == bench:
        file.seek(0)
        for _ in range(64):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
"""
WRITERS = 2


@dataclass(frozen=True)
class Condition:
    """Circumstances under which plays are measured.

    Attributes
    ----------
    busy : bool
        The machine is made busy, so that ordinary priority belongs to the condition.
    """

    name: str
    sentence: str
    during: Callable[[Browser], AbstractContextManager[None]]
    busy: bool = False
    browsers: tuple[str, ...] = ("chromium", "firefox")


@contextmanager
def _throttled(browser: Browser) -> Iterator[None]:
    browser.ask("throttle", rate=6)
    yield


@contextmanager
def _blocked(browser: Browser) -> Iterator[None]:
    browser.ask("block", busy_ms=100, every_ms=250)
    yield


@contextmanager
def _processes(count: int, program: str, *arguments: str) -> Iterator[None]:
    command = [sys.executable, "-c", program, *arguments]
    running = [subprocess.Popen(command) for _ in range(count)]
    try:
        yield
    finally:
        for process in running:
            process.kill()
            process.wait()


def _hogs(_: Browser) -> AbstractContextManager[None]:
    return _processes(HOGS, HOG)


def _disk(_: Browser) -> AbstractContextManager[None]:
    return _processes(WRITERS, WRITER, os.environ.get("TMPDIR", tempfile.gettempdir()))


CONDITIONS = {
    one.name: one
    for one in (
        Condition("idle", "nothing else", lambda _: nullcontext()),
        Condition("throttle", "page's CPU slowed 6 times", _throttled, browsers=("chromium",)),
        Condition("blocked", "page's main thread blocked 100 of every 250 ms", _blocked),
        Condition("hogs", f"{HOGS} processes that compute", _hogs, busy=True),
        Condition("disk", f"{WRITERS} processes that write 64 MB and wait for the disk", _disk, busy=True),
    )
}
