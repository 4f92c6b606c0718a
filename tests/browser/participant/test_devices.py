"""Devices as they are: a phone with fingers only, a browser that is too old, a page without https."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Route

from tests.browser.conftest import CHROMIUM_FLAGS, system_chromium
from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, STUDY, without
from tests.browser.visit import Visit, axe_violations

pytestmark = pytest.mark.browser
EVENTS = "SELECT data FROM run_events"
PHONE = {"width": 390, "height": 844}
INSECURE_HOST = "study.test"


@pytest.fixture
def phone(chromium: Browser) -> Iterator[BrowserContext]:
    """A phone held upright: a coarse pointer, no mouse, a small window."""
    context = chromium.new_context(
        viewport=PHONE, screen=PHONE, device_scale_factor=3, has_touch=True, is_mobile=True, locale="en-GB"
    )
    yield context
    context.close()


def test_a_phone_goes_through_everything_by_tapping(
    server: ServerProcess, tmp_path: Path, phone: BrowserContext
) -> None:
    small = ("full_screen = false", "full_screen = false\ninter_ocular_mm = 40.0")
    study = server.add_study(tmp_path / "clips", without(STUDY, small))
    server.start()
    page = phone.new_page()
    wide: list[str] = []

    def tap(selector: str) -> None:
        page.wait_for_selector(selector)
        beyond = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        if beyond > 0:
            wide.append(f"{beyond} px at {selector}")
        page.tap(selector)

    def answer(selector: str) -> None:
        scale = page.wait_for_selector(".scale")
        tap(selector)
        assert scale is not None
        scale.wait_for_element_state("hidden")

    visit = Visit(page, server.address).open(study.link_token)
    for selector in ("text=Start", ".page > .tick", ".primary"):
        tap(selector)
    page.wait_for_selector("form")
    page.fill("input.short", "34")
    for selector in ("text=Normal without", ".likert .step >> nth=6", ".primary"):
        tap(selector)
    page.wait_for_selector(".card-upright")  # a card lying down is wider than a phone
    for number in (1, 2):
        page.wait_for_selector(f".card-area[data-round='{number}']")
        page.fill(".card-area input", "300")
        tap("text=Larger")
        tap("text=It fits")
    tap("text=Yes, within")
    page.wait_for_selector("text=in centimeters")  # the blind spot lies outside so small a screen
    tap(".primary")
    for selector in (".prose ol >> xpath=ancestor::section//button[1]", "text=Continue"):
        tap(selector)
    while page.wait_for_selector(".ready, .attention, .break, .feedback, form, .prose h1"):
        if page.query_selector(".ready"):
            assert "Tap" in page.inner_text(".ready")
            tap(".clip")
            answer(".key >> nth=5")
        elif page.query_selector(".attention"):
            answer(f".key[data-value='{page.inner_text('.question strong')}']")
        elif page.query_selector("form"):
            tap("text=The lower lid")
            break
        else:
            tap(".primary:enabled")
            page.wait_for_timeout(300)
    tap(".primary")
    page.wait_for_selector(".code")
    assert wide == []
    assert visit.problems == []
    rows = server.rows("SELECT response FROM ratings WHERE kind = 'main'")
    assert [row["response"] for row in rows] == [6] * 6
    measured = server.rows("SELECT px_per_mm, viewing_distance_mm FROM calibrations")[0]
    assert measured["px_per_mm"] == pytest.approx(301 / 85.6, abs=0.001)
    assert measured["viewing_distance_mm"] == 600


def test_a_clip_wider_than_a_phone_fits_it_and_widens_no_page(
    server: ServerProcess, tmp_path: Path, phone: BrowserContext
) -> None:
    narrow = without(PLAIN, ("minimum_width_px = 320", "minimum_width_px = 200"))
    study = server.add_study(tmp_path / "clips", narrow)
    server.start()
    page = phone.new_page()
    page.set_viewport_size({"width": 240, "height": 520})
    Visit(page, server.address).open(study.link_token).begin()
    while page.wait_for_selector(".ready, .prose, .page h1") and not page.query_selector(".ready"):
        page.tap(".primary:enabled")
        page.wait_for_timeout(300)
    page.wait_for_timeout(300)  # the window may follow the page, and the clip the window
    box = page.locator(".clip").evaluate("element => element.getBoundingClientRect().toJSON()")
    sides = page.evaluate("[innerWidth, document.documentElement.scrollWidth]")
    assert (box["left"], box["width"], sides) == (0, 240, [240, 240])


def test_a_study_for_keyboards_turns_a_phone_away(
    server: ServerProcess, tmp_path: Path, phone: BrowserContext
) -> None:
    declared = without(PLAIN, ("full_screen = false", "full_screen = false\nallow_touch = false"))
    study = server.add_study(tmp_path / "clips", declared)
    server.start()
    page = phone.new_page()
    Visit(page, server.address).open(study.link_token)
    page.wait_for_selector("text=needs a keyboard")
    page.wait_for_load_state("networkidle")
    assert axe_violations(page) == []
    assert server.rows_soon(f"{EVENTS} WHERE data LIKE '%gate_touch%'", 1)
    assert server.rows("SELECT 1 FROM study_runs") == []


@pytest.mark.parametrize(
    ("before", "script"),
    [
        ("delete HTMLScriptElement.prototype.noModule", None),
        ("", "this is [no script that any browser can read"),
    ],
    ids=["knows no modules", "cannot read the script"],
)
def test_a_browser_that_is_too_old_is_told_so(
    server: ServerProcess, tmp_path: Path, page: Page, before: str, script: str | None
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    page.add_init_script(before)

    def spoil(route: Route) -> None:
        route.fulfill(body=script, content_type="text/javascript") if script else route.abort()

    page.route("**/assets/participant/index-*.js", spoil)
    page.goto(f"{server.address}/run/{study.link_token}")
    page.wait_for_selector("text=too old for the study", timeout=20_000)
    assert "Dieser Browser ist zu alt" in page.inner_text("main")
    page.wait_for_load_state("networkidle")
    assert axe_violations(page) == []
    assert server.rows_soon(f"{EVENTS} WHERE data LIKE '%old_browser%'", 1)


def test_a_page_whose_every_script_was_lost_can_be_loaded_again(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN)
    server.start()
    page.route("**/assets/participant/*.js*", lambda route: route.abort())
    page.goto(f"{server.address}/run/{study.link_token}")
    link = page.get_by_role("link", name="Reload the page")
    assert not link.is_visible()
    page.evaluate("document.getAnimations().forEach((one) => one.finish())")
    assert axe_violations(page) == []
    page.unroute_all()
    link.click()
    page.wait_for_selector("h1")


@pytest.fixture
def insecure(chromium: Browser) -> Iterator[Page]:
    """A page whose address is neither https nor this machine's own name, as in a laboratory without https."""
    rule = f"--host-resolver-rules=MAP {INSECURE_HOST} 127.0.0.1"
    browser = chromium.browser_type.launch(executable_path=system_chromium(), args=[*CHROMIUM_FLAGS, rule])
    yield browser.new_page(locale="en-GB")
    browser.close()


@pytest.mark.parametrize("screens_devices", [False, True])
def test_a_page_without_https_explains_itself(
    server: ServerProcess, tmp_path: Path, insecure: Page, screens_devices: bool
) -> None:
    rule = ("[texts.en]", '[[screening]]\nrule = "device"\n\n[texts.en]')
    study = server.add_study(tmp_path / "clips", without(PLAIN, rule) if screens_devices else PLAIN)
    server.start()
    Visit(insecure, f"http://{INSECURE_HOST}:{server.port}").open(study.link_token)
    insecure.wait_for_selector("text=https://")
    assert insecure.evaluate("isSecureContext") is False
    assert axe_violations(insecure) == []
    insecure.wait_for_load_state("networkidle")
    assert server.rows_soon(f"{EVENTS} WHERE data LIKE '%gate_insecure%'", 1)
    statuses = [row["status"] for row in server.rows("SELECT status FROM study_runs")]
    assert statuses == (["screened_out"] if screens_devices else [])
