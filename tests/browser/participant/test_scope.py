"""The short form of `make scope`: records against the frame buffer, on a few plays in each browser."""

import logging
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from screen_bench.browser import program
from screen_bench.compare import POLL_MS, REFRESH_MS, Play
from screen_bench.conditions import CONDITIONS
from screen_bench.display import Display, missing_here
from screen_bench.measure import measure
from screen_bench.pairs import APART_MS, measure_pairs
from screen_bench.results import cells
from screen_bench.views import count_views

from tests.browser.server_process import ServerProcess
from tests.helpers.processor_waits import ProcessorWaits

pytestmark = pytest.mark.browser
LOG = logging.getLogger(__name__)
PLAYS, FPS = 4, 30
TRIES, PAIRS = 5, 3


@pytest.fixture(scope="module")
def display(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Display]:
    """A separate display."""
    missing = missing_here()
    if missing:
        pytest.skip(missing)
    with Display(tmp_path_factory.mktemp("display")) as opened:
        yield opened


@pytest.fixture
def running(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[ServerProcess]:
    """A server; the bench takes in its studies itself, and a second try finds none of the first."""
    server = ServerProcess(tmp_path_factory.mktemp("scope") / "data")
    yield server.start()
    server.stop()


@pytest.mark.parametrize("browser", ["chromium", pytest.param("firefox", marks=pytest.mark.firefox)])
def test_what_is_recorded_was_on_the_screen(
    display: Display, running: ServerProcess, tmp_path: Path, browser: str
) -> None:
    if program(browser) is None:
        pytest.skip(f"no {browser} here: run `make setup-test`")
    before_others = os.geteuid() == 0
    with ProcessorWaits(own_lateness=not before_others) as waits:
        row = measure(display, running, tmp_path, browser, FPS, CONDITIONS["idle"], PLAYS, before_others)
    LOG.info("%s", cells(row))
    assert row.lost == 0
    measured = [play for play in row.plays if play.is_measured]
    assert measured, "the poller was held up in every play: is this machine overloaded?"
    drawn = {index for play in measured for index, _ in play.record.drawn}
    seen = {index for play in measured for index, _ in play.sight.onsets}
    assert seen <= drawn
    for play in measured:
        waited_ms = waits.within(*on_the_wall_clock(play))
        LOG.info(
            "off %.1f ms, late %.1f ms, waited %.1f ms", play.worst_off_ms, play.worst_late_ms, waited_ms
        )
        assert max(play.worst_off_ms, play.worst_late_ms) <= REFRESH_MS + POLL_MS + waited_ms
        assert play.missing * 1000 / FPS <= waited_ms


def on_the_wall_clock(play: Play) -> tuple[float, float]:
    """From the start key to the end of the clip, in ms."""
    offset_ms = 1000 * (time.time() - time.monotonic())
    return play.pressed_ms + offset_ms, play.sight.ended_ms + offset_ms


def test_as_many_views_are_stored_as_were_on_the_screen(
    display: Display, running: ServerProcess, tmp_path: Path
) -> None:
    if program("chromium") is None:
        pytest.skip("no chromium here: run `make setup-test`")
    count = count_views(display, running, tmp_path, "chromium", TRIES)
    LOG.info("%s", count.line())
    assert count.is_right, count.line()
    assert set(count.stored) <= {"shown", "interrupted"}


def test_two_clips_on_one_canvas_are_never_a_frame_apart(
    display: Display, running: ServerProcess, tmp_path: Path
) -> None:
    if program("chromium") is None:
        pytest.skip("no chromium here: run `make setup-test`")
    row = measure_pairs(display, running, tmp_path, "chromium", FPS, PAIRS, os.geteuid() == 0)
    LOG.info("%s", row.line())
    assert row.seen == PAIRS
    assert row.differing_records == 0
    # What lay between two looks at the screen is not known: the looks may be that far apart.
    assert row.apart == 0 or row.blind_ms > APART_MS
