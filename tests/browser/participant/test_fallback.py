"""Browsers without WebCodecs go through a whole study, and a refused record holds nobody up."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route

from tests.browser.conftest import REPOSITORY
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
FRAMES = 30
PAUSE_MS = 1_200
"""As a person looks at a ready screen: the paused first frame was decoded long before the key."""
WITHOUT = "delete window.VideoDecoder; delete window.OffscreenCanvas;"
WITHOUT_FRAMES = f"{WITHOUT} delete HTMLVideoElement.prototype.requestVideoFrameCallback;"
PRACTISED = without(PLAIN, ("[playback]", "[playback]\nflag_video_fallback = false"))
UNPRACTISED = without(PRACTISED, ("trials = 1", "trials = 0"))
STRICT = without(UNPRACTISED, ("failed_missing_frames = 10_000", "failed_missing_frames = 3"))


def pass_gate(page: Page) -> None:
    page.wait_for_selector("text=Before you begin")
    page.click(".primary")


def go_through(page: Page, address: str, link: str) -> str:
    visit = Visit(page, address, lambda name: page.wait_for_timeout(PAUSE_MS) if name == "ready" else None)
    page.goto(f"{address}/run/{link}")
    pass_gate(page)
    visit.begin().instructions().trials()
    return visit.code()


def main_plays(server: ServerProcess) -> list[dict[str, Any]]:
    return server.rows("SELECT * FROM ratings WHERE kind = 'main' ORDER BY time_elapsed")


@pytest.mark.parametrize("missing", [WITHOUT, WITHOUT_FRAMES], ids=["no_webcodecs", "no_frame_callbacks"])
def test_a_person_gets_the_code_and_no_good_play_is_flagged(
    server: ServerProcess, tmp_path: Path, page: Page, missing: str
) -> None:
    study = server.add_study(tmp_path / "clips", STRICT, frames=FRAMES)
    server.start()
    page.add_init_script(missing)
    assert go_through(page, server.address, study.link_token)
    rows = main_plays(server)
    assert [row["play"] for row in rows] == [1] * 6
    assert {row["method"] for row in rows} == {"video"}
    # A machine that is busy may lose a picture; the first frame is not what is lost.
    assert sum(row["verdict"] == "uncertain" for row in rows) >= 5, rows
    assert all(0 <= row["key_to_first_frame_ms"] < 1000 and row["rt"] >= 0 for row in rows)
    assert {row["refused"] for row in server.rows(REFUSED)} == {0}
    drawn = server.rows("SELECT drawn FROM trial_ratings WHERE drawn != '[]'")
    logs = [json.loads(row["drawn"]) for row in drawn]
    assert all(log[0][0] == 0 and all(ms >= 0 for _, ms in log) for log in logs)
    known = missing == WITHOUT
    assert all((row["frames_missing"] is not None) == known for row in rows)


REFUSED = "SELECT count(*) AS refused FROM run_events WHERE type = 'record_refused'"


def test_a_person_with_firefox_too(server: ServerProcess, tmp_path: Path) -> None:
    firefox = next((path for name in ("firefox-esr", "firefox") if (path := shutil.which(name))), None)
    if firefox is None or not (REPOSITORY / "frontend" / "node_modules" / "puppeteer-core").is_dir():
        pytest.skip("no Firefox, or the frontend's packages are not installed: run `make setup-test`")
    study = server.add_study(tmp_path / "clips", PRACTISED, frames=FRAMES)
    server.start()
    address = f"{server.address}/run/{study.link_token}"
    command = ["node", "tests/firefox/visit.mjs", firefox, address, WITHOUT, str(PAUSE_MS)]
    done = subprocess.run(
        command, cwd=REPOSITORY / "frontend", capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.strip().splitlines()[-1])["code"]
    rows = main_plays(server)
    assert len(rows) == 6
    assert sum(row["verdict"] == "uncertain" for row in rows) >= 5, rows
    assert server.rows(REFUSED) == [{"refused": 0}]


@pytest.mark.parametrize("status", [400, 403, 413, 422])
def test_a_permanent_refusal_of_one_answer_still_leads_to_the_code(
    server: ServerProcess, tmp_path: Path, page: Page, status: int
) -> None:
    """Something on the way refuses one answer whenever it comes: the server gets it by another way."""
    study = server.add_study(tmp_path / "clips", UNPRACTISED)
    server.start()
    sent: list[str] = []

    def refuse(route: Route) -> None:
        body = json.loads(route.request.post_data or "{}")
        if body.get("trial_index") != 1:
            return route.continue_()
        sent.append(route.request.url)
        return route.fulfill(status=status, body="<h1>no</h1>")

    page.route("**/api/run/ratings/*", refuse)
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    visit.trials()
    assert visit.code()
    assert len(sent) == 1
    assert len(main_plays(server)) == 6


def test_an_answer_that_nobody_can_store_leads_to_the_code_and_to_the_experimenter(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", UNPRACTISED)
    server.start()

    def damage(route: Route) -> None:
        body = json.loads(route.request.post_data or "{}")
        record = body["body"] if route.request.url.endswith("/refused") else body
        if record.get("trial_index") == 1:
            record["answer"] = {"kind": "clip_rating", "answers": {"rating": {"response": 77}}}
        route.continue_(post_data=json.dumps(body))

    page.route("**/api/run/ratings/*", damage)
    page.route("**/api/run/refused", damage)
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    visit.trials()
    assert visit.code()
    [event] = server.rows("SELECT data FROM run_events WHERE type = 'record_refused'")
    assert "from 1 to 7" in json.loads(event["data"])["reason"]
    assert len(main_plays(server)) == 5
