"""A virtual display with its frame buffer in a file, and key presses as a keyboard makes them."""

import ctypes
import ctypes.util
import os
import shutil
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Self

WIDTH_PX, HEIGHT_PX = 1280, 800
PRIORITY = 40
KEYSYMS = {"space": 0x20, **{str(digit): 0x30 + digit for digit in range(10)}}


def missing_here() -> str:
    """What this machine lacks for the bench, as one line; empty where it has all."""
    lacking = [name for name in ("Xvfb", "node") if shutil.which(name) is None]
    lacking += [f"lib{name}" for name in ("X11", "Xtst") if ctypes.util.find_library(name) is None]
    return f"no {', '.join(lacking)} here: sudo apt-get install xvfb libxtst6" if lacking else ""


class Display:
    """Xvfb, for the time of a `with`.

    Attributes
    ----------
    scan_out : bool, optional
        Give it real-time priority, as hardware that reads out a frame buffer waits for no program.
    """

    def __init__(self, folder: Path, scan_out: bool = True) -> None:
        self.folder, self.scan_out = folder, scan_out
        self.framebuffer = folder / "Xvfb_screen0"
        self.name = ""

    def __enter__(self) -> Self:
        reading, writing = os.pipe()
        screen = f"{WIDTH_PX}x{HEIGHT_PX}x24"
        command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", screen, "-fbdir", str(self.folder)]
        self._process = subprocess.Popen(
            [*command, "-nolisten", "tcp"], pass_fds=[writing], stderr=subprocess.DEVNULL
        )
        os.close(writing)
        with os.fdopen(reading) as told:
            self.name = f":{told.readline().strip()}"
        if self.name == ":":
            raise RuntimeError("Xvfb did not start")
        self.scan_out = self.scan_out and self._before_others()
        self._keyboard = Keyboard(self.name)
        return self

    def _before_others(self) -> bool:
        try:
            os.sched_setscheduler(self._process.pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except PermissionError:
            return False
        return True

    def press(self, key: str) -> float:
        """Press and release a key; returns when, CLOCK_MONOTONIC in ms."""
        return self._keyboard.press(key)

    def click(self, x: int, y: int) -> None:
        """Move the pointer there and click, which also gives that window the keys."""
        self._keyboard.click(x, y)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._keyboard.close()
        self._process.terminate()
        self._process.wait(timeout=10)


class Keyboard:
    """The XTEST extension: programs cannot distinguish what it sends from a keyboard."""

    def __init__(self, display: str) -> None:
        self._x11 = ctypes.CDLL(ctypes.util.find_library("X11"))
        self._test = ctypes.CDLL(ctypes.util.find_library("Xtst"))
        self._x11.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x11.XOpenDisplay(display.encode()))
        if not self._display:
            raise RuntimeError(f"the display {display} cannot be opened")

    def press(self, key: str) -> float:
        code = self._x11.XKeysymToKeycode(self._display, ctypes.c_ulong(KEYSYMS[key]))
        pressed_ms = time.monotonic() * 1000
        self._test.XTestFakeKeyEvent(self._display, code, 1, ctypes.c_ulong(0))
        self._x11.XFlush(self._display)
        time.sleep(0.03)
        self._test.XTestFakeKeyEvent(self._display, code, 0, ctypes.c_ulong(0))
        self._x11.XFlush(self._display)
        return pressed_ms

    def click(self, x: int, y: int) -> None:
        self._test.XTestFakeMotionEvent(self._display, -1, x, y, ctypes.c_ulong(0))
        for down in (1, 0):
            self._test.XTestFakeButtonEvent(self._display, 1, down, ctypes.c_ulong(0))
        self._x11.XFlush(self._display)

    def close(self) -> None:
        self._x11.XCloseDisplay(self._display)
