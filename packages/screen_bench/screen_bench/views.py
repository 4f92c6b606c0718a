"""Views on the frame buffer against views in the ledger, whatever happens to page, browser and device."""

import itertools
import json
import random
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from screen_bench import bars
from screen_bench.browser import Browser
from screen_bench.clips import declaration, make_clip_folder
from screen_bench.compare import sights
from screen_bench.display import HEIGHT_PX, WIDTH_PX, Display
from screen_bench.framebuffer import FrameBuffer
from screen_bench.measure import SETTLE_S, poller
from screen_bench.poller import ROWS
from tests.browser.server_process import ServerProcess

FPS = 30
CLIP_S = 2.0
"""Long enough for a slow machine to break a clip off in its midst."""
ON_SCREEN_LIMIT_S = 5.0
LOOK_EVERY_S = 0.002
MID_CLIP_S = 0.5
STORED = (
    "SELECT v.outcome AS outcome, count(*) AS count FROM views v "
    "WHERE v.study_run_id = (SELECT max(id) FROM study_runs) GROUP BY v.outcome"
)


@dataclass(frozen=True)
class Way:
    """What happens to a try: a command to the driver, in mid-clip or on the scale; none: nothing."""

    name: str
    command: str = ""
    mid_clip: bool = True


WAYS = (
    Way("reload in mid-clip", "reload"),
    Way("reload on the scale", "reload", mid_clip=False),
    Way("kill -9 of the browser in mid-clip", "kill"),
    Way("another device in mid-clip", "move"),
    Way("nothing"),
    Way("kill -9 of the browser on the scale", "kill", mid_clip=False),
    Way("another device on the scale", "move", mid_clip=False),
)


@dataclass(frozen=True)
class ViewCount:
    """What a browser showed and what the server stored of it.

    Attributes
    ----------
    seen : int
        Clips on the frame buffer.
    stored : dict of str to int
        Rows of the ledger by outcome.
    tries : dict of str to int
        How many of each way.
    """

    browser: str
    tries: dict[str, int]
    seen: int
    stored: dict[str, int]

    @property
    def is_right(self) -> bool:
        """As many stored as seen, and as many as were started."""
        return self.seen == sum(self.stored.values()) == sum(self.tries.values())

    def line(self) -> str:
        """One line for people."""
        stored = ", ".join(f"{count} {outcome}" for outcome, count in sorted(self.stored.items()))
        tries = ", ".join(f"{count} {name}" for name, count in self.tries.items())
        verdict = "equal" if self.is_right else "NOT EQUAL"
        return (
            f"{self.browser}: {sum(self.tries.values())} tries ({tries}): "
            f"{self.seen} views on the frame buffer, {sum(self.stored.values())} stored ({stored}): {verdict}"
        )


def count_views(display: Display, server: ServerProcess, folder: Path, browser: str, tries: int) -> ViewCount:
    """Show a clip in each of so many tries, let something happen to it, and count from outside."""
    name = f"views_{browser}"
    text = declaration(name, FPS, tries + 1)
    make_clip_folder(text, folder / name, FPS, seconds=CLIP_S)
    study = server.add_built_study(folder / name, text)
    address = f"{server.address}/run/{server.link(study, 'personal')}"
    done: dict[str, int] = {}
    with Browser(browser, display.name) as driver:
        driver.ask("open", address=address)
        driver.wait_for("ready")
        area = driver.clip_area()
        buffer = FrameBuffer(display.framebuffer)
        row = buffer.row(area, ROWS[0])
        log_file = folder / f"{name}.json"
        with poller(display.framebuffer, area, log_file):
            for way in itertools.islice(itertools.cycle(WAYS), tries):
                _one_try(display, driver, way, address, lambda: bars.read(buffer.values(row)) >= 0)
                if driver.clip_area() != area:
                    raise RuntimeError(
                        "the clip lies elsewhere than before; the poller looks at its old place"
                    )
                done[way.name] = done.get(way.name, 0) + 1
            time.sleep(SETTLE_S)
        stored = _stored(server, tries)
    seen = sights(
        [(at_ms, upper, lower) for at_ms, upper, lower in json.loads(log_file.read_text())["changes"]]
    )
    return ViewCount(browser, done, len(seen), stored)


def _one_try(display: Display, driver: Browser, way: Way, address: str, shows: Callable[[], bool]) -> None:
    # Next to the clip: a window that has just been opened may not have the keys yet.
    display.click(WIDTH_PX - 40, HEIGHT_PX - 40)
    time.sleep(SETTLE_S)
    display.press("space")
    limit = time.monotonic() + ON_SCREEN_LIMIT_S
    while not shows():
        if time.monotonic() > limit:
            raise RuntimeError("the start key did not bring a clip; is the page's window in front?")
        time.sleep(LOOK_EVERY_S)
    if way.mid_clip:
        time.sleep(random.uniform(0, MID_CLIP_S))
    else:
        time.sleep(CLIP_S)
        driver.wait_for("scale")
    if way.command:
        driver.ask(way.command, address=address)
    while driver.wait_for("scale", "ready") == "scale":
        display.click(WIDTH_PX - 40, HEIGHT_PX - 40)
        display.press("4")
        time.sleep(SETTLE_S)


def _stored(server: ServerProcess, tries: int, limit_s: float = 30.0) -> dict[str, int]:
    """The ledger's rows by outcome, once there are as many as tries or no more come."""
    limit = time.monotonic() + limit_s
    while True:
        rows = server.rows(STORED)
        counts = {str(row["outcome"] or "begun"): int(row["count"]) for row in rows}
        if (sum(counts.values()) >= tries and "begun" not in counts) or time.monotonic() > limit:
            return counts
        time.sleep(0.2)
