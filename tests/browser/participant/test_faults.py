"""A server that is killed again and again behind a network that loses, doubles, delays and reorders requests.

PALPEBRA_FAULTS=full is the long run: the two minutes without a connection of the issue's text.
"""

import json
import logging
import os
import random
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Error, Page

from tests.browser.conftest import REPOSITORY
from tests.browser.fault_proxy import FaultProxy
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
LOG = logging.getLogger(__name__)
FULL = os.environ.get("PALPEBRA_FAULTS") == "full"
PARTICIPANTS, TRIALS = 26, 80
OFFLINE_S = 120.0 if FULL else 6.0
# The short run shortens the participants' pauses between tries, and paces their answers more slowly instead:
# it waits less, and as many requests meet faults and a server that is down.
HURRY, PACE_MS = (1, 60) if FULL else (4, 120)
SHARE = 0.1
MANY = (
    without(
        PLAIN,
        ("per_cell = 3", "per_cell = 5"),
        ('split_by = "character"', "repeats = 8"),
        ("trials = 1", "trials = 0"),
        ('order = "fixed"', 'order = "random"'),
    ).split("[[forms]]")[0]
    + PLAIN[PLAIN.index("[texts.en]") :]
)


@pytest.fixture
def driver(tmp_path: Path) -> Path:
    """The participants' program, built from the page's own sources."""
    if not (REPOSITORY / "frontend" / "node_modules").is_dir():
        pytest.skip("the frontend's packages are not installed: run `make setup-test`")
    out = str(tmp_path / "driver")
    command = ["npx", "vite", "build", "-c", "tests/faults/vite.config.ts", "--logLevel", "error"]
    command += ["--ssr", "tests/faults/driver.ts", "--outDir", out]
    subprocess.run(command, cwd=REPOSITORY / "frontend", check=True, timeout=120)
    return next((tmp_path / "driver").glob("driver.*js"))


def kill_again_and_again(server: ServerProcess, over: threading.Event, kills: list[float]) -> None:
    """On a slow machine a start takes long, so the time up grows with it: about as long up as down."""
    chance, start_s = random.Random(5), 4.0
    while not over.wait(chance.uniform(0.3, 0.9) * max(4.0, start_s)):
        server.kill()
        kills.append(time.monotonic())
        over.wait(chance.uniform(0.0, 1.0))
        began = time.monotonic()
        server.start()
        start_s = time.monotonic() - began


def test_nothing_acknowledged_is_lost_and_nothing_is_stored_twice(
    server: ServerProcess, tmp_path: Path, driver: Path
) -> None:
    study = server.add_study(tmp_path / "clips", MANY)
    server.start()
    proxy = FaultProxy(server.port, SHARE, seed=11).start()
    out, over, kills = tmp_path / "acknowledged.json", threading.Event(), list[float]()
    killer = threading.Thread(target=kill_again_and_again, args=(server, over, kills))
    numbers = [f"{number:g}" for number in (PARTICIPANTS, PACE_MS, HURRY)]
    command = ["node", str(driver), proxy.address, study.link_token, *numbers]
    with out.open("wb") as told_here, (tmp_path / "driver.log").open("wb") as log:
        node = subprocess.Popen(command, stdout=told_here, stderr=log)
    killer.start()
    try:
        time.sleep(8)
        proxy.offline = True
        time.sleep(OFFLINE_S)
        proxy.offline = False
        code = node.wait(timeout=900)
    finally:
        over.set()
        node.kill()
        killer.join()
        proxy.stop()
    assert code == 0, (tmp_path / "driver.log").read_text()[-3000:]
    told = json.loads(out.read_text())
    compare(
        told,
        server.rows(
            "SELECT t.*, r.public_id AS run FROM trial_ratings t JOIN study_runs r ON r.id = t.study_run_id"
        ),
    )
    assert {row["status"] for row in server.rows("SELECT status FROM study_runs")} == {"complete"}
    figures = (told["given"], len(kills), told["reloads"], OFFLINE_S, dict(proxy.counts))
    LOG.info("%d ratings, %d kills, %d reloads, %.0f s offline, %s", *figures)
    assert len(kills) >= 2


def compare(told: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    """Each acknowledged rating is stored as it was given; nothing is stored twice; nothing was refused."""
    stored = {row["rating_id"]: row for row in rows}
    acknowledged = {one["rating_id"]: one for one in told["acknowledged"]}
    assert told["refused"] == []
    lost = [one for one in acknowledged.values() if one["rating_id"] not in stored]
    assert lost == []
    for one in acknowledged.values():
        row = stored[one["rating_id"]]
        answered = json.loads(row["payload"])["response"]
        assert (row["run"], row["trial_index"], answered) == (
            one["run_id"],
            one["trial_index"],
            one["response"],
        )
    assert len({(row["run"], row["trial_index"], row["play"]) for row in rows}) == len(rows)
    assert len(rows) == len(acknowledged) == PARTICIPANTS * TRIALS >= 2_000


def opened_at_last(visit: Visit, link: str) -> Visit:
    """Where the page itself or its scripts are lost on the way, a person loads it again."""
    for _ in range(120):
        try:
            visit.page.goto(f"{visit.address}/run/{link}", timeout=30_000)
            visit.page.wait_for_selector("h1:not(:has-text('too old')), .trial", timeout=15_000)
        except Error:
            time.sleep(1)
            continue
        return visit
    raise AssertionError("expected the page within 120 loads")


def test_each_file_of_the_page_lost_once(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    """Modules, the worker and style sheets are asked for again: no clip is broken, nothing reloaded."""
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    proxy = FaultProxy(server.port, share=0.0, seed=0).start()
    visit = Visit(page, proxy.address).open(study.link_token)
    proxy.lost_once = "/assets/participant/"
    visit.begin().instructions().practice()
    assert visit.trials(most=1) == 1
    assert page.evaluate("[...document.querySelectorAll('link[rel=stylesheet]')].every((link) => link.sheet)")
    visit.trials()
    proxy.stop()
    assert {"worker", "points"} <= {Path(path).name.split("-")[0] for path in proxy.lost}
    assert server.rows("SELECT 1 FROM run_events WHERE type = 'clip_unavailable'") == []
    assert {row["status"] for row in server.rows("SELECT status FROM study_runs")} == {"complete"}


def test_a_browser_goes_through_the_same(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(tmp_path / "clips", without(PLAIN, ("per_cell = 3", "per_cell = 5")))
    server.start()
    proxy = FaultProxy(server.port, SHARE, seed=3).start()
    over, kills = threading.Event(), list[float]()
    # A form waits for the server, up to 15 s between two tries, and each may meet a server that is down.
    page.set_default_timeout(180_000)
    visit = opened_at_last(Visit(page, proxy.address), study.link_token).begin().instructions().practice()
    killer = threading.Thread(target=kill_again_and_again, args=(server, over, kills))
    killer.start()
    try:
        while not page.query_selector(".code"):
            visit.trials(most=4)
            if len(kills) < 4 and page.query_selector(".ready"):
                opened_at_last(visit, study.link_token)
                page.wait_for_selector(".prose", timeout=60_000)
                visit.instructions()
    finally:
        over.set()
        killer.join()
        proxy.stop()
    rows = server.rows("SELECT trial_index, play, response FROM ratings WHERE kind = 'main' AND play = 1")
    assert sorted(row["response"] for row in rows) == [4] * 10
    assert {row["status"] for row in server.rows("SELECT status FROM study_runs")} == {"complete"}
