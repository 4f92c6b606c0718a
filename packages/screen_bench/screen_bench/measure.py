"""One row of the table: a run of plays in one browser, at one rate, under one condition."""

import itertools
import json
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from screen_bench.browser import ROOT, Browser
from screen_bench.clips import CLIP_S, declaration, frames_at, make_clip_folder
from screen_bench.compare import Play, Record, Sight, compare, pair, sights
from screen_bench.conditions import Condition
from screen_bench.display import HEIGHT_PX, WIDTH_PX, Display
from screen_bench.framebuffer import ClipArea
from tests.browser.server_process import ServerProcess

QUERY = """
SELECT t.* FROM trial_ratings t JOIN study_runs r ON r.id = t.study_run_id
WHERE r.id = (SELECT max(id) FROM study_runs) ORDER BY t.time_elapsed
"""
SETTLE_S = 0.3
AFTER_CLIP_S = 0.25
NUMBERS = itertools.count(1)
"""Each piece of a row is a separate study."""


@dataclass(frozen=True)
class Row:
    """The plays of one browser, frame rate and condition.

    Attributes
    ----------
    lost : int
        Plays whose clip was never seen on the screen.
    loads : tuple of float
        The machine's load average over the last minute, of each piece of the row.
    blind_ms, blind_share : float
        The poller's own longest hold-up, and the share of its time that hold-ups took.
    """

    browser: str
    version: str
    fps: int
    condition: str
    plays: tuple[Play, ...]
    lost: int
    polls_per_s: float
    real_time: bool
    loads: tuple[float, ...]
    blind_ms: float
    blind_share: float


def measure(
    display: Display,
    server: ServerProcess,
    folder: Path,
    browser: str,
    fps: int,
    condition: Condition,
    plays: int,
    before_others: bool,
) -> Row:
    """Show `plays` clips and compare each with its record."""
    name = f"{browser}_{fps}_{condition.name}_{next(NUMBERS)}"
    text = declaration(name, fps, plays)
    make_clip_folder(text, folder / name, fps)
    study = server.add_built_study(folder / name, text)
    with Browser(browser, display.name, before_others and not condition.busy) as driver:
        driver.ask("open", address=f"{server.address}/run/{study.link_token}")
        driver.wait_for("ready")
        # Next to the clip and the button: until then the browser's own bar may have the keys.
        display.click(WIDTH_PX - 40, HEIGHT_PX - 40)
        log_file = folder / f"{name}.json"
        with poller(display.framebuffer, driver.clip_area(), log_file), condition.during(driver):
            presses = [_one_play(display, driver) for _ in range(plays)]
            time.sleep(SETTLE_S)
        version = driver.version
    log = json.loads(log_file.read_text())
    compared, lost = _compare(server, log, presses, frames_at(fps), fps)
    rate = log["polls"] / max(log["seconds"], 1e-9)
    return Row(
        browser,
        version,
        fps,
        condition.name,
        tuple(compared),
        lost,
        rate,
        log["real_time"],
        (os.getloadavg()[0],),
        *blind(log),
    )


def blind(log: dict[str, Any]) -> tuple[float, float]:
    """The poller's longest hold-up (ms), and the share of its time in which it was held up."""
    held_up = [end - start for start, end in log["held_up"]]
    return max(held_up, default=0.0), sum(held_up) / max(1000 * log["seconds"], 1e-9)


def _one_play(display: Display, driver: Browser) -> float:
    driver.wait_for("ready")
    # Presses fall anywhere between two refreshes, as a person's do.
    time.sleep(SETTLE_S + random.uniform(0, 1 / 60))
    pressed_ms = display.press("space")
    # The page is left alone while the clip runs.
    time.sleep(CLIP_S + AFTER_CLIP_S)
    if driver.wait_for("scale", "ready") == "scale":
        display.press(str(random.randint(1, 7)))
        time.sleep(AFTER_CLIP_S)
    else:
        raise RuntimeError("the start key did not reach the page; is its window in front?")
    return pressed_ms


@contextmanager
def poller(framebuffer: Path, area: ClipArea, output: Path) -> Iterator[None]:
    """The poller's process, for the time of a `with`; it writes its log at the end."""
    numbers = [str(value) for value in (area.left, area.top, area.width, area.height)]
    command = [sys.executable, "-m", "screen_bench.poller", str(framebuffer), *numbers, str(output)]
    process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    if process.stdout is None or not process.stdout.readline():
        raise RuntimeError("the poller did not start; see above")
    try:
        yield
    finally:
        process.communicate(timeout=30)


def _compare(
    server: ServerProcess, log: dict[str, Any], presses: list[float], frames: int, fps: int
) -> tuple[list[Play], int]:
    seen: list[Sight] = sights([(at_ms, upper, lower) for at_ms, upper, lower in log["changes"]])
    server.rows_soon(
        "SELECT * FROM trial_ratings WHERE study_run_id = (SELECT max(id) FROM study_runs)", len(presses)
    )
    records = stored_plays(server, frames, fps)
    held_up = [(start, end) for start, end in log["held_up"]]
    plays: list[Play] = []
    pairs = pair(presses, seen, records)
    for pressed_ms, number, record in zip(presses, pairs, records, strict=True):
        if number is not None:
            plays.append(compare(record, pressed_ms, seen[number], held_up))
    return plays, pairs.count(None)


def stored_plays(server: ServerProcess, frames: int, fps: float) -> list[Record]:
    """Every play of the latest run, in the order shown."""
    return [_record(row, frames, fps) for row in server.rows(QUERY)]


def _record(row: dict[str, Any], frames: int, fps: float) -> Record:
    drawn = _json(row["drawn"]) or []
    return Record(
        drawn=tuple((int(index), float(at_ms)) for index, at_ms in drawn),
        frames=frames,
        fps=fps,
        verdict=row["verdict"],
        rule=row["verdict_rule"] or "",
        key_to_first_frame_ms=row["key_to_first_frame_ms"],
        clock_gap_ms=row["clock_gap_ms"],
        clock_late_ms=row["clock_late_ms"],
    )


def _json(value: Any) -> Any:
    return json.loads(value) if isinstance(value, str) else value
