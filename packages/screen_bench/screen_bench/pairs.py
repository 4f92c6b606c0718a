"""Two clips on one canvas: are they ever a frame apart, on the frame buffer or in the record?"""

import json
import random
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from screen_bench.browser import Browser
from screen_bench.clips import CLIP_S, declaration, frames_at, make_clip_folder
from screen_bench.compare import REFRESH_MS, Change, sights
from screen_bench.display import HEIGHT_PX, WIDTH_PX, Display
from screen_bench.measure import AFTER_CLIP_S, SETTLE_S, poller
from server.cli_common import migrated_services
from server.models import View, ViewClip
from server.participation.views import unpack_log
from tests.browser.server_process import ServerProcess

CLIP_HEIGHT_PX = 120
"""Two of them, one above the other, fit into the window: the poller's two rows then lie in one clip each."""
TRIAL = """
kind = "paired_comparison"
question = { en = "Which?" }
pairs = { among = "all", exemplars = "matched" }
presentation = { arrangement = "stacked", gap_mm = 4.0 }
"""
APART_MS = REFRESH_MS / 2
"""A display that is being written shows two frames for a moment; clips a frame apart do so for a refresh."""


@dataclass(frozen=True)
class PairRow:
    """The pairs of one browser and frame rate.

    Attributes
    ----------
    seen : int
        Pairs on the frame buffer.
    apart_ms : float
        The longest time for which the two showed different frames.
    apart : int
        Pairs for which that was longer than half a refresh.
    differing_records : int
        Pairs whose two stored logs differ.
    missing : int
        Frames never on the screen, over all pairs.
    blind_ms : float
        The poller's longest hold-up.
    """

    browser: str
    fps: int
    plays: int
    seen: int
    apart: int
    apart_ms: float
    differing_records: int
    missing: int
    blind_ms: float

    def line(self) -> str:
        """One line for people."""
        return (
            f"{self.browser}, {self.fps} fps: {self.plays} pairs, {self.seen} seen; "
            f"a frame apart on the frame buffer: {self.apart} (longest {self.apart_ms:.1f} ms), "
            f"in the record: {self.differing_records}; {self.missing} frames not shown; "
            f"poller held up for {self.blind_ms:.1f} ms at most"
        )


def measure_pairs(
    display: Display,
    server: ServerProcess,
    folder: Path,
    browser: str,
    fps: int,
    plays: int,
    before_others: bool,
) -> PairRow:
    """Show `plays` pairs of bar-coded clips and compare the two from outside and in the ledger."""
    name = f"pairs_{browser}_{fps}"
    text = pair_declaration(name, fps, plays)
    make_clip_folder(text, folder / name, fps, CLIP_HEIGHT_PX)
    study = server.add_built_study(folder / name, text)
    log_file = folder / f"{name}.json"
    with Browser(browser, display.name, before_others) as driver:
        driver.ask("open", address=f"{server.address}/run/{study.link_token}")
        driver.wait_for("ready")
        display.click(WIDTH_PX - 40, HEIGHT_PX - 40)
        with poller(display.framebuffer, driver.clip_area(), log_file):
            for _ in range(plays):
                _one_pair(display, driver)
            time.sleep(SETTLE_S)
    log = json.loads(log_file.read_text())
    records = _records(server, plays)
    return pair_row(browser, fps, plays, log, records)


def pair_declaration(name: str, fps: int, plays: int) -> str:
    """The bench's study with a level more and a pair for each exemplar."""
    text = declaration(name, fps, plays)
    head, tail = text[: text.index("[trial]\n")], text[text.index("[texts.en]") :]
    head = head.replace(
        '{ name = "a", label = "A" }', '{ name = "a", label = "A" }, { name = "b", label = "B" }'
    )
    exemplars, blocks = head.index("[exemplars]"), head.index("[blocks]")
    head = f"{head[:exemplars]}[exemplars]\nper_cell = {plays}\n{head[blocks:]}"
    head = "\n".join(line for line in head.splitlines() if not line.startswith("repeats = "))
    return f"{head}\n[trial]{TRIAL}{tail}"


def pair_row(
    browser: str,
    fps: int,
    plays: int,
    log: dict[str, Any],
    records: Sequence[tuple[object, ...]],
) -> PairRow:
    """Put both sides together."""
    changes = [(at_ms, upper, lower) for at_ms, upper, lower in log["changes"]]
    seen = sights(changes)
    apart = apart_by_pair(changes)
    return PairRow(
        browser,
        fps,
        plays,
        seen=len(seen),
        apart=sum(longest > APART_MS for longest in apart),
        apart_ms=max(apart, default=0.0),
        differing_records=sum(len(set(logs)) != 1 for logs in records),
        missing=sum(frames_at(fps) - len({frame for frame, _ in one.onsets}) for one in seen),
        blind_ms=max((end - start for start, end in log["held_up"]), default=0.0),
    )


def apart_by_pair(changes: Sequence[Change]) -> list[float]:
    """For each pair the longest time (ms) for which both clips were readable and showed different frames."""
    longest: list[float] = []
    inside = False
    for (at_ms, upper, lower), after in pairwise(changes):
        readable = upper >= 0 and lower >= 0
        if readable and not inside:
            longest.append(0.0)
        inside = readable or (inside and not (upper == lower == -1))
        if readable and upper != lower:
            longest[-1] = max(longest[-1], after[0] - at_ms)
    return longest


def _one_pair(display: Display, driver: Browser) -> None:
    driver.wait_for("ready")
    time.sleep(SETTLE_S + random.uniform(0, 1 / 60))
    display.press("space")
    time.sleep(CLIP_S + AFTER_CLIP_S)
    if driver.wait_for("scale", "ready") != "scale":
        raise RuntimeError("the start key did not reach the page; is its window in front?")
    display.press(random.choice("12"))
    time.sleep(AFTER_CLIP_S)


def _records(server: ServerProcess, plays: int) -> list[tuple[object, ...]]:
    """The stored frame logs of each pair of the latest run, one log per clip."""
    latest = "(SELECT max(id) FROM study_runs)"
    server.rows_soon(f"SELECT id FROM views WHERE study_run_id = {latest} AND outcome = 'shown'", plays)
    with migrated_services(server.settings) as services, services.database.read() as session:
        run = session.query(View.study_run_id).order_by(View.study_run_id.desc()).limit(1).scalar()
        views = session.query(View).where(View.study_run_id == run).all()
        return [
            tuple(
                repr(unpack_log(clip.frame_log))
                for clip in session.query(ViewClip).where(ViewClip.view == view.id).order_by(ViewClip.role)
            )
            for view in views
        ]
