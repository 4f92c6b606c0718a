"""Browsers, screens, links and clips that will not do: the participant reads why, the server knows."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, STUDY, without
from tests.browser.visit import Visit, axe_violations, fit_card

pytestmark = pytest.mark.browser
EVENTS = "SELECT type, data FROM run_events"
RATED_AT_THE_OTHER_RATE = "SELECT 1 FROM ratings WHERE refresh_rate_hz BETWEEN 52.55 AND 52.65"
# Stamps that are 19 ms apart, 52.6 Hz, however late the machine calls: a play that runs at 60 says no
# other rate, as one that is more than 15% faster than measured would (decision 0800).
OTHER_REFRESH_RATE = """
    let stamp = 0;
    window.requestAnimationFrame = (draw) => setTimeout(() => draw((stamp += 19)), 1);
"""

# What a tab opened behind another one is to its page: no refreshes until somebody looks at it.
IN_THE_BACKGROUND = """
    const draw = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = () => 0;
    window.lookAt = () => {
        window.requestAnimationFrame = draw;
        document.dispatchEvent(new Event("visibilitychange"));
    };
"""
MEASURED_RATE = "SELECT 1 FROM study_runs WHERE json_extract(device, '$.refresh_rate_hz')"


def is_recorded(server: ServerProcess, what: str) -> bool:
    """Whether an event of this type, or with this word in its data, arrives at the server."""
    return bool(server.rows_soon(f"{EVENTS} WHERE type = '{what}' OR data LIKE '%{what}%'", 1))


def test_links_that_lead_nowhere(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open("no-such-link")
    page.wait_for_selector("text=This link is not valid")
    assert axe_violations(page) == []
    study.change(status="closed")
    visit.open(study.link_token)
    page.wait_for_selector("text=not open at the moment")


@pytest.mark.parametrize(
    ("hide", "sentence", "reason"),
    [
        ("Object.defineProperty(window, 'isSecureContext', {value: false})", "https://", "gate_insecure"),
        (
            "delete window.VideoDecoder; HTMLVideoElement.prototype.play = undefined",
            "recent Chrome",
            "gate_browser",
        ),
    ],
)
def test_a_browser_that_cannot(
    server: ServerProcess, tmp_path: Path, page: Page, hide: str, sentence: str, reason: str
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    page.add_init_script(hide)
    Visit(page, server.address).open(study.link_token)
    page.wait_for_selector(f"text={sentence}")
    page.wait_for_load_state("networkidle")
    assert axe_violations(page) == []
    assert is_recorded(server, reason)


def test_a_screen_that_is_too_small(server: ServerProcess, tmp_path: Path, chromium: Browser) -> None:
    study = server.add_study(
        tmp_path / "clips", without(PLAIN, ("minimum_width_px = 320", "minimum_width_px = 800"))
    )
    server.start()
    phone = {"width": 390, "height": 700}
    context = chromium.new_context(
        viewport=phone, screen=phone, has_touch=True, is_mobile=True, locale="en-GB"
    )
    page = context.new_page()
    Visit(page, server.address).open(study.link_token)
    page.wait_for_selector("text=800 by 300")
    page.wait_for_load_state("networkidle")
    assert axe_violations(page) == []
    context.close()
    assert is_recorded(server, "gate_screen")


def test_without_h264_the_participant_is_warned_and_may_try(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    page.add_init_script("VideoDecoder.isConfigSupported = async (config) => ({config, supported: false})")
    visit = Visit(page, server.address).open(study.link_token)
    page.wait_for_selector("text=H.264")
    page.wait_for_load_state("networkidle")
    assert axe_violations(page) == []
    page.click("text=Continue anyway")
    visit.begin()
    assert is_recorded(server, "gate_h264")


def test_without_webcodecs_the_video_element_is_used_and_flagged(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN, frames=20)
    server.start()
    page.add_init_script("delete window.VideoDecoder")
    visit = Visit(page, server.address).open(study.link_token)
    page.wait_for_selector("text=ordinary video")
    page.click(".primary")
    visit.begin().instructions().practice()
    assert visit.trials(most=3) == 3
    rows = server.rows_soon("SELECT * FROM ratings WHERE kind = 'main'", 3)
    assert {row["method"] for row in rows} == {"video"}
    assert {row["verdict"] for row in rows} <= {"flagged", "failed"}
    assert is_recorded(server, "gate_video")


def test_without_storage_each_answer_waits_for_the_server(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    page.add_init_script("""
        const denied = () => { throw new DOMException('denied', 'SecurityError') };
        IDBFactory.prototype.open = denied;
        for (const name of ['localStorage', 'sessionStorage'])
            Object.defineProperty(window, name, {get: denied});
    """)
    visit = Visit(page, server.address).open(study.link_token)
    page.wait_for_selector("text=each answer must reach the server")
    page.click(".primary")
    visit.begin().instructions().practice()
    visit.trials(most=1)
    page.wait_for_selector(".ready")
    assert len(server.rows("SELECT 1 FROM ratings WHERE kind = 'main'")) == 1
    assert is_recorded(server, "storage_blocked")
    visit.trials()
    assert visit.code()
    assert visit.problems == []


def test_a_start_page_that_is_reloaded_has_begun_nothing(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address)
    for _ in range(2):
        visit.open(study.link_token)
        page.wait_for_selector("text=About")
    assert server.rows("SELECT 1 FROM study_runs") == []
    study.change(status="closed")
    visit.open(study.link_token)
    page.wait_for_selector("text=not open at the moment")


def test_a_clip_that_is_corrupt_once_is_fetched_again(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    spoilt: list[str] = []

    def spoil(route: Route) -> None:
        if route.request.url in spoilt:
            return route.continue_()
        spoilt.append(route.request.url)
        return route.fulfill(body=b"not a clip", content_type="video/mp4")

    page.route("**/clips/*.mp4", spoil)
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    visit.trials()
    assert {row["method"] for row in server.rows_soon("SELECT * FROM ratings WHERE kind = 'main'", 6)} == {
        "webcodecs"
    }


def test_a_clip_that_is_gone_is_told_and_passed_over(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    gone: list[str] = []

    def lose(route: Route) -> None:
        if not gone:
            gone.append(route.request.url)
        lost = route.request.url == gone[0]
        return route.fulfill(status=404, body="") if lost else route.continue_()

    page.route("**/clips/*.mp4", lose)
    visit = Visit(page, server.address).open(study.link_token).begin().instructions()
    page.click(".primary")
    page.wait_for_selector("text=Some clips could not be loaded", timeout=60_000)
    assert axe_violations(page) == []
    page.click("text=Continue without these clips")
    page.wait_for_selector("text=This clip cannot be shown", timeout=60_000)
    assert axe_violations(page) == []
    assert is_recorded(server, "clip_unavailable")
    assert all("pageerror" not in problem for problem in visit.problems)


def test_a_clip_too_large_for_the_window_is_refused(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(
        tmp_path / "clips",
        without(STUDY, ("full_screen = false", "full_screen = false\ninter_ocular_mm = 300.0")),
    )
    server.start()
    Visit(page, server.address).open(study.link_token).begin()
    page.wait_for_selector(".card")
    fit_card(page)
    page.click("text=Yes, within")
    page.wait_for_selector("text=The clip does not fit")
    assert axe_violations(page) == []


def test_zoom_keeps_the_size_and_another_screen_asks_again(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(
        tmp_path / "clips", without(STUDY, ("viewing_distance = true", "viewing_distance = false"))
    )
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin()
    fit_card(page)
    page.click("text=Yes, within")
    visit.instructions().practice()
    page.wait_for_selector(".ready, .attention")
    before = server.rows("SELECT px_per_mm FROM calibrations ORDER BY id")[-1]["px_per_mm"]
    page.evaluate("Object.defineProperty(window, 'devicePixelRatio', {value: 2, configurable: true})")
    visit.trials(most=1)
    page.wait_for_selector(".ready, .attention, .break")
    after = server.rows_soon("SELECT px_per_mm FROM calibrations ORDER BY id", 2)[-1]["px_per_mm"]
    assert after == pytest.approx(before / 2, rel=1e-3)
    page.evaluate("Object.defineProperty(screen, 'width', {value: 3000, configurable: true})")
    page.keyboard.press(" ") if page.query_selector(".ready") else None
    visit_or_asked(page, visit)
    page.wait_for_selector("text=Your screen has changed")
    assert axe_violations(page) == []
    page.evaluate(OTHER_REFRESH_RATE)
    page.click(".primary")
    fit_card(page)
    page.click("text=Yes, within")
    visit.trials(most=1)
    assert server.rows_soon(RATED_AT_THE_OTHER_RATE, 1)


def test_a_clip_shown_on_another_screen_before_the_size_is_known_there_is_flagged(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    page.wait_for_selector(".ready")
    page.evaluate("Object.defineProperty(screen, 'width', {value: 3000, configurable: true})")
    visit.rate()
    row = server.rows_soon("SELECT * FROM ratings WHERE kind = 'main' AND method = 'webcodecs'", 1)[0]
    assert "zoomed" in row["disturbances"]


def visit_or_asked(page: Page, visit: Visit) -> None:
    """End the trial that was on the screen when it changed."""
    if page.query_selector(".attention"):
        page.keyboard.press(page.inner_text(".question strong"))
    else:
        visit.page.wait_for_selector(".scale")
        visit.page.keyboard.press("4")


def test_a_page_opened_in_the_background_measures_its_screen_when_it_is_looked_at(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    page.add_init_script(IN_THE_BACKGROUND)
    visit = Visit(page, server.address).open(study.link_token).begin()
    server.rows_soon(f"{MEASURED_RATE} IS NULL AND json_extract(device, '$.webcodecs')", 1)
    page.evaluate("lookAt()")
    server.rows_soon(f"{MEASURED_RATE} BETWEEN 10 AND 1000", 1)
    assert visit.problems == []


def test_a_card_that_nobody_has_touched_and_an_impossible_screen_are_refused(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", STUDY)
    server.start()
    Visit(page, server.address).open(study.link_token).begin()
    page.wait_for_selector(".card")
    page.click("text=It fits")
    page.wait_for_selector("text=Hold a card against the screen and change")
    page.fill(".card-area input", "120")
    page.click("text=It fits")
    page.wait_for_selector("text=your screen would be 91 cm wide")
    fit_card(page)
    page.wait_for_selector("text=Yes, within")
