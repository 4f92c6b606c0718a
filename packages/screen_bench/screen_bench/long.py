"""Clips of a minute: is each frame on the frame buffer, and does the browser's memory stay what it was?"""

import json
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from screen_bench import bars
from screen_bench.browser import Browser
from screen_bench.clips import declaration, frames_at, make_clip_folder
from screen_bench.compare import Sight, sights
from screen_bench.display import HEIGHT_PX, WIDTH_PX, Display
from screen_bench.measure import SETTLE_S, poller, stored_plays
from tests.browser.server_process import ServerProcess

LONG_S = 60.0
AFTER_CLIP_S = 2.0
MEMORY_EVERY_S = 0.5


@dataclass(frozen=True)
class LongPlay:
    """One long clip, as it was shown and as it was recorded.

    Attributes
    ----------
    shown : int
        Frames on the frame buffer, of `frames`.
    logged : int
        In the record.
    differing : int
        In one of both only.
    lost : tuple of int
        The frames that never were on the frame buffer.
    memory_mb : (float, float)
        Of all processes of the browser, before the clip, and the most while it was shown.
    """

    frames: int
    shown: int
    logged: int
    differing: int
    lost: tuple[int, ...]
    verdict: str
    memory_mb: tuple[float, float]
    blind_ms: float


@dataclass(frozen=True)
class LongRow:
    """Plays of one clip length in one browser."""

    browser: str
    fps: int
    plays: tuple[LongPlay, ...]

    def line(self) -> str:
        """One line for people."""
        told = "; ".join(
            f"{play.shown} of {play.frames} frames on the frame buffer, {play.logged} in the record, "
            f"{play.differing} in one of both only, verdict {play.verdict}, "
            f"memory {play.memory_mb[0]:.0f} MB before and {play.memory_mb[1]:.0f} MB at most, "
            f"poller held up for {play.blind_ms:.1f} ms at most"
            for play in self.plays
        )
        return f"{self.browser}, {LONG_S:g} s at {self.fps} fps: {told}"


def measure_long(
    display: Display,
    server: ServerProcess,
    folder: Path,
    browser: str,
    fps: int,
    plays: int,
    before_others: bool,
) -> LongRow:
    """Show `plays` clips of a minute and compare each with its record."""
    name = f"long_{browser}_{fps}"
    text = declaration(name, fps, plays)
    make_clip_folder(text, folder / name, fps, seconds=LONG_S)
    study = server.add_built_study(folder / name, text)
    log_file = folder / f"{name}.json"
    memory: list[tuple[float, float]] = []
    with Browser(browser, display.name, before_others) as driver:
        driver.ask("open", address=f"{server.address}/run/{study.link_token}")
        driver.wait_for("ready")
        display.click(WIDTH_PX - 40, HEIGHT_PX - 40)
        with poller(display.framebuffer, driver.clip_area(), log_file):
            for _ in range(plays):
                memory.append(_one_play(display, driver))
            time.sleep(SETTLE_S)
    log = json.loads(log_file.read_text())
    seen = sights([(at_ms, upper, lower) for at_ms, upper, lower in log["changes"]])
    server.rows_soon(
        "SELECT * FROM trial_ratings WHERE study_run_id = (SELECT max(id) FROM study_runs)", plays
    )
    records = stored_plays(server, frames_at(fps, LONG_S), fps)
    held_up = [(start, end) for start, end in log["held_up"]]
    return LongRow(
        browser,
        fps,
        tuple(
            long_play(
                sight, [index for index, _ in record.drawn], record.frames, record.verdict, used, held_up
            )
            for sight, record, used in zip(seen, records, memory, strict=True)
        ),
    )


def long_play(
    sight: Sight,
    logged: Sequence[int],
    frames: int,
    verdict: str,
    memory_mb: tuple[float, float],
    held_up: Sequence[tuple[float, float]],
) -> LongPlay:
    """Put one play's two sides together."""
    shown = set(unwrapped([number for number, _ in sight.onsets]))
    blind = [end - start for start, end in held_up if end > sight.onsets[0][1] and start < sight.ended_ms]
    differing = len(shown ^ set(logged))
    lost = tuple(sorted(set(range(frames)) - shown))
    blind_ms = max(blind, default=0.0)
    return LongPlay(frames, len(shown), len(set(logged)), differing, lost, verdict, memory_mb, blind_ms)


def unwrapped(numbers: Sequence[int]) -> list[int]:
    """Frame numbers of a clip whose bars restart every 64 frames; fewer than 64 may be lost at a time."""
    indices: list[int] = []
    for number in numbers:
        before = indices[-1] if indices else -1
        indices.append(before + 1 + (number - before - 1) % bars.MAX_FRAMES)
    return indices


def _one_play(display: Display, driver: Browser) -> tuple[float, float]:
    driver.wait_for("ready")
    time.sleep(SETTLE_S)
    before = memory_mb(driver.pid)
    with _watched(driver.pid) as used:
        display.press("space")
        # The page is left alone while the clip runs.
        time.sleep(LONG_S + AFTER_CLIP_S)
    if driver.wait_for("scale", "ready") != "scale":
        raise RuntimeError("the start key did not reach the page; is its window in front?")
    display.press("4")
    time.sleep(SETTLE_S)
    return before, max(used)


@contextmanager
def _watched(pid: int) -> Iterator[list[float]]:
    """Memory of a process and its children, every half second, for the time of a `with`."""
    used, done = [memory_mb(pid)], threading.Event()

    def watch() -> None:
        while not done.wait(MEMORY_EVERY_S):
            used.append(memory_mb(pid))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield used
    finally:
        done.set()
        watcher.join()


def memory_mb(pid: int) -> float:
    """Memory of a process and all that it started, shared pages counted once (PSS), in MB."""
    try:
        told = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="utf-8")
        children = " ".join(file.read_text() for file in Path(f"/proc/{pid}/task").glob("*/children"))
    except OSError:
        return 0.0
    own_kb = next((int(line.split()[1]) for line in told.splitlines() if line.startswith("Pss:")), 0)
    return own_kb * 1024 / 1e6 + sum(memory_mb(int(child)) for child in children.split())
