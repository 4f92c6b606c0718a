"""Programs in a real browser: one whose script clicks, one whose keys come from the operating system."""

import os
import random
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page
from screen_bench.display import HEIGHT_PX, WIDTH_PX, Display, missing_here
from sqlalchemy import select

from server.cli_common import migrated_services
from server.models import StudyRun
from server.participation.evidence import Judgement
from server.participation.judgement import judge_run
from tests.browser.conftest import CHROMIUM_FLAGS, system_chromium
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser

STUDY = PLAIN.replace("per_cell = 3", "per_cell = 5")
SCRIPT = """() => setInterval(() => {
  const send = (type, key) =>
    document.body.dispatchEvent(new KeyboardEvent(type, { key, code: key, bubbles: true, cancelable: true }));
  const press = (key) => ["keydown", "keyup"].forEach((type) => send(type, key));
  if (document.querySelector(".ready")) press(" ");
  else if (document.querySelector(".scale")) press("4");
  else document.querySelector(".primary:enabled")?.click();
}, 60)"""


@pytest.fixture
def strict(tmp_path: Path, built_page: Path) -> Iterator[ServerProcess]:
    """A server that refuses answers without evidence."""
    process = ServerProcess(tmp_path / "data", evidence="refuse")
    yield process
    process.stop()


def judgement(process: ServerProcess) -> Judgement:
    with migrated_services(process.settings) as services, services.database.read() as session:
        return judge_run(session, session.scalars(select(StudyRun)).one())


def test_a_headless_browser_whose_script_clicks_is_not_a_person(
    strict: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = strict.add_study(tmp_path / "clips", STUDY, frames=4)
    strict.start()
    visit = Visit(page, strict.address).open(study.link_token)
    visit.begin()
    page.evaluate(SCRIPT)
    page.wait_for_selector(".code", timeout=300_000)
    judged = judgement(strict)
    assert (judged.signals.tickets, judged.signals.digests) == (1, 1)
    assert judged.signals.trusted == pytest.approx(0, abs=0.1), "the presses of the set-up alone"
    assert judged.verdict == "unlikely"


def test_a_driven_browser_with_lengthened_presses_and_a_persons_times_is_unclear_at_most(
    strict: ServerProcess, tmp_path: Path, page: Page
) -> None:
    """No disguise: keys held for 12 to 40 ms as on a busy machine, answers and waits at random."""
    study = strict.add_study(tmp_path / "clips", STUDY, frames=4)
    strict.start()
    Visit(page, strict.address).open(study.link_token).begin()
    rng, deadline = random.Random(5), time.monotonic() + 300
    while page.query_selector(".code") is None:
        assert time.monotonic() < deadline, page.inner_text("body")
        if page.query_selector(".primary:enabled"):
            page.click(".primary:enabled", no_wait_after=True, delay=rng.uniform(12, 40))
        elif page.query_selector(".scale"):
            page.wait_for_timeout(rng.uniform(320, 900))
            page.keyboard.press(str(rng.randint(1, 7)), delay=rng.uniform(12, 40))
        elif page.query_selector(".ready, .feedback"):
            page.keyboard.press("Space", delay=rng.uniform(12, 40))
        page.wait_for_timeout(40)
    judged = judgement(strict)
    assert (judged.signals.tickets, judged.signals.digests, judged.signals.trusted) == (1, 1, 1)
    assert judged.signals.press_ms is not None
    assert judged.signals.press_ms > 12
    assert judged.verdict == "unclear"


def with_keys(display: Display, page: Page) -> None:
    """Go through the trials by keys that look like a keyboard's, and look at nothing."""
    deadline = time.monotonic() + 300
    while page.query_selector(".code") is None:
        assert time.monotonic() < deadline, page.inner_text("body")
        if page.query_selector(".primary:enabled"):
            page.click(".primary:enabled", no_wait_after=True)
        elif page.query_selector(".scale"):
            display.press("4")
        elif page.query_selector(".ready, .feedback"):
            display.press("space")
        page.wait_for_timeout(50)


@pytest.mark.skipif(bool(missing_here()), reason=missing_here())
def test_keys_of_the_operating_system_are_trusted(
    strict: ServerProcess, tmp_path: Path, chromium: Browser
) -> None:
    """Passes every check that events are the browser's own; docs/explanation/evidence.md says so."""
    study = strict.add_study(tmp_path / "clips", STUDY, frames=4)
    strict.start()
    with Display(tmp_path, scan_out=False) as display:
        browser = chromium.browser_type.launch(
            headless=False,
            executable_path=system_chromium(),
            env={**os.environ, "DISPLAY": display.name},
            args=[
                *CHROMIUM_FLAGS,
                "--kiosk",
                f"--window-size={WIDTH_PX},{HEIGHT_PX}",
                "--window-position=0,0",
            ],
        )
        page = browser.new_context(no_viewport=True, locale="en-GB").new_page()
        Visit(page, strict.address).open(study.link_token).begin()
        display.click(WIDTH_PX // 2, HEIGHT_PX - 5)
        with_keys(display, page)
        browser.close()
    judged = judgement(strict)
    assert (judged.signals.tickets, judged.signals.digests, judged.signals.trusted) == (1, 1, 1)
    assert judged.signals.interaction == 1
    assert judged.signals.same_answer == 1
    assert judged.verdict != "likely", "for its answers: nothing of its input is against it but evenness"
