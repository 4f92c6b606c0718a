"""The short form of `make scope`: the record against the frame buffer, on a few plays in each browser."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.browser.server_process import ServerProcess
from tools.scope.browser import program
from tools.scope.conditions import CONDITIONS
from tools.scope.display import Display, missing_here
from tools.scope.measure import measure
from tools.scope.table import cells

pytestmark = [pytest.mark.browser, pytest.mark.slow]
LOG = logging.getLogger(__name__)
PLAYS, FPS = 4, 30


@pytest.fixture
def display(tmp_path: Path) -> Iterator[Display]:
    """A display of its own."""
    missing = missing_here()
    if missing:
        pytest.skip(missing)
    folder = tmp_path / "display"
    folder.mkdir()
    with Display(folder) as opened:
        yield opened


@pytest.mark.parametrize("browser", ["chromium", pytest.param("firefox", marks=pytest.mark.firefox)])
def test_what_is_recorded_was_on_the_screen(
    display: Display, server: ServerProcess, tmp_path: Path, browser: str
) -> None:
    if program(browser) is None:
        pytest.skip(f"no {browser} here: run `make setup-test`")
    before_others = os.geteuid() == 0
    server.start()
    row = measure(display, server, tmp_path, browser, FPS, CONDITIONS["idle"], PLAYS, before_others)
    LOG.info("%s", cells(row))
    assert row.lost == 0
    measured = [play for play in row.plays if play.is_measured]
    assert measured, "the poller was held up in every play: is this machine overloaded?"
    drawn = {index for play in measured for index, _ in play.record.drawn}
    seen = {index for play in measured for index, _ in play.sight.onsets}
    assert seen <= drawn
    right = [play for play in measured if play.is_right]
    if os.getloadavg()[0] <= (os.cpu_count() or 1):
        assert len(right) == len(measured)
        assert not any(play.is_off for play in measured)
