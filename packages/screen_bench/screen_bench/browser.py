"""A headed browser driven by `frontend/tests/scope/driver.mjs`, one JSON line per question."""

import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from screen_bench.framebuffer import ClipArea

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = {
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
    "firefox": ("firefox-esr", "firefox"),
}
LIMIT_S = 60.0


def program(browser: str) -> str | None:
    """The path of the installed browser."""
    return next((path for name in PROGRAMS[browser] if (path := shutil.which(name))), None)


class Browser:
    """One browser with a separate profile, for the time of a `with`.

    Attributes
    ----------
    before_others : bool, optional
        Give it real-time priority, so that the machine's other programs do not slow it down.
    """

    def __init__(self, name: str, display: str, before_others: bool = False) -> None:
        self.name, self.display, self.before_others = name, display, before_others

    def __enter__(self) -> Self:
        path = program(self.name)
        if path is None:
            raise RuntimeError(f"no {self.name} here: sudo apt-get install {PROGRAMS[self.name][0]}")
        priority = ["chrt", "--rr", "1"] if self.before_others else []
        self._process = subprocess.Popen(
            [*priority, "node", "tests/scope/driver.mjs", self.name, path],
            cwd=ROOT / "frontend",
            env={**os.environ, "DISPLAY": self.display},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.version = self._read()
        return self

    @property
    def pid(self) -> int:
        """Of the driver, whose children the browser's processes are."""
        return self._process.pid

    def ask(self, command: str, **values: object) -> Any:
        """The driver's answer to a command."""
        if self._process.stdin is None:
            raise RuntimeError("the browser is gone")
        self._process.stdin.write(json.dumps({"command": command, **values}) + "\n")
        self._process.stdin.flush()
        return self._read()

    def _read(self) -> Any:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise RuntimeError(f"{self.name} ended; see above")
        answer = json.loads(line)
        if "error" in answer:
            raise RuntimeError(f"{self.name}: {answer['error']}")
        return answer["answer"]

    def wait_for(self, *states: str, limit_s: float = LIMIT_S, pause_s: float = 0.05) -> str:
        """Wait until the page is in one of the states; the page goes through consent and texts by itself."""
        limit = time.monotonic() + limit_s
        state = ""
        while time.monotonic() < limit:
            state = str(self.ask("state"))
            if state in states:
                return state
            time.sleep(pause_s)
        raise RuntimeError(
            f"expected the page at {' or '.join(states)} in {limit_s:.0f} s, it is at: {state}"
        )

    def clip_area(self) -> ClipArea:
        """Where the clip lies on the display."""
        return ClipArea(*self.ask("area"))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.stdin:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout:
            self._process.stdout.close()
