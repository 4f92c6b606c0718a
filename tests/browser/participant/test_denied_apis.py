"""Storage, locks and workers that are absent, denied, silent or full: each leads to the completion code."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.conftest import CHROMIUM_FLAGS, REPOSITORY, system_chromium
from tests.browser.served import Served, serve
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
SHORT = without(PLAIN, ("per_cell = 3", "per_cell = 1"), ("trials = 1", "trials = 0"))
DENIED = "const denied = () => { throw new DOMException('denied', 'SecurityError'); };"
FULL = "const full = () => { throw new DOMException('full', 'QuotaExceededError'); };"
SILENT = "const silent = () => new Promise(() => {});"


def replaced(owner: str, name: str, getter: str) -> str:
    return f"Object.defineProperty({owner}, '{name}', {{ configurable: true, get: {getter} }});"


def of_storage(name: str) -> dict[str, str]:
    own = f"const own = window.{name}; "
    stub = "({{ getItem: {}, setItem: {}, removeItem: {} }})"
    return {
        f"{name} absent": replaced("window", name, "() => undefined"),
        f"{name} denied": DENIED + replaced("window", name, "denied"),
        f"{name} throws": DENIED + replaced("window", name, f"() => {stub.format(*['denied'] * 3)}"),
        f"{name} full": FULL
        + own
        + replaced("window", name, f"() => {stub.format('() => null', 'full', '() => null')}"),
    }


FAULTS = {
    **of_storage("localStorage"),
    **of_storage("sessionStorage"),
    "indexedDB absent": replaced("window", "indexedDB", "() => undefined"),
    "indexedDB denied": DENIED + replaced("window", "indexedDB", "denied"),
    "indexedDB throws": DENIED + "IDBFactory.prototype.open = denied;",
    "indexedDB rejects": "IDBFactory.prototype.open = () => { const asked = {};"
    " setTimeout(() => asked.onerror?.(new Event('error'))); return asked; };",
    "indexedDB silent": "IDBFactory.prototype.open = () => ({});",
    "indexedDB full": FULL + "IDBObjectStore.prototype.put = full;",
    "indexedDB closed": DENIED + "IDBDatabase.prototype.transaction = denied;",
    "indexedDB writes silent": "const own = IDBDatabase.prototype.transaction;"
    " IDBDatabase.prototype.transaction = function (names, mode, ...more) {"
    " if (mode !== 'readwrite') return own.call(this, names, mode, ...more);"
    " return { objectStore: () => ({ put() {}, delete() {} }) }; };",
    "indexedDB reads silent": "IDBObjectStore.prototype.getAll = () => ({});",
    "locks absent": replaced("navigator", "locks", "() => undefined"),
    "locks denied": DENIED + replaced("navigator", "locks", "denied"),
    "locks throws": DENIED + "LockManager.prototype.request = denied;",
    "locks rejects": "LockManager.prototype.request ="
    " () => Promise.reject(new DOMException('no', 'SecurityError'));",
    "locks silent": SILENT + "LockManager.prototype.request = silent;",
    "Worker absent": "delete window.Worker;",
    "Worker denied": DENIED + "window.Worker = class { constructor() { denied(); } };",
    "Worker rejects": "window.Worker = class { constructor()"
    " { setTimeout(() => this.onerror?.(new Event('error'))); } terminate() {} };",
    "Worker silent": "window.Worker = class { postMessage() {} terminate() {} };",
    "canvas kept": DENIED + "HTMLCanvasElement.prototype.transferControlToOffscreen = denied;",
    "serviceWorker absent": replaced("navigator", "serviceWorker", "() => undefined"),
    "serviceWorker denied": DENIED + replaced("navigator", "serviceWorker", "denied"),
    "serviceWorker rejects": "ServiceWorkerContainer.prototype.register ="
    " () => Promise.reject(new Error('no'));",
    "serviceWorker silent": SILENT + "ServiceWorkerContainer.prototype.register = silent;",
    "BroadcastChannel absent": "delete window.BroadcastChannel;",
    "cookies denied": DENIED + replaced("Document.prototype", "cookie", "denied"),
}

DAMAGED = """
const own = Storage.prototype.getItem;
Storage.prototype.getItem = function (key) {
  const kept = own.call(this, key);
  return /^[0-9a-f-]{36}$/.test(kept ?? "") ? "damaged" : kept;
};
"""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, built_page: Path) -> Iterator[Served]:
    with serve(tmp_path_factory.mktemp("denied"), {"short": (SHORT, 8), "practised": (PLAIN, 8)}) as opened:
        yield opened


def go_through(page: Page, served: Served) -> str:
    visit = Visit(page, served.server.address)
    page.goto(f"{served.server.address}/run/{served.studies['short'].link_token}")
    page.wait_for_selector("h1")
    page.wait_for_function("document.querySelector('.primary')")
    while "Before you begin" in page.inner_text("h1"):
        page.click(".primary")
        page.wait_for_timeout(200)
    visit.begin().instructions()
    assert visit.trials() == 2
    return visit.code()


@pytest.mark.parametrize("fault", FAULTS)
def test_each_leads_to_the_code(served: Served, page: Page, fault: str) -> None:
    page.add_init_script(f"{{ {FAULTS[fault]} }}")
    assert go_through(page, served)


def test_all_at_once_lead_to_the_code(served: Served, page: Page) -> None:
    for fault in ("localStorage denied", "sessionStorage denied", "indexedDB denied", "locks rejects"):
        page.add_init_script(f"{{ {FAULTS[fault]} }}")
    for fault in ("Worker denied", "serviceWorker denied", "cookies denied"):
        page.add_init_script(f"{{ {FAULTS[fault]} }}")
    assert go_through(page, served)


def test_a_full_disk_without_a_connection_says_what_it_waits_for(served: Served, page: Page) -> None:
    page.add_init_script(f"{{ {FAULTS['indexedDB full']} }}")
    visit = Visit(page, served.server.address)
    page.goto(f"{served.server.address}/run/{served.studies['short'].link_token}")
    visit.begin().instructions()
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".scale")
    page.context.set_offline(True)
    page.keyboard.press("4")
    page.wait_for_selector(".waiting:has-text('not saved yet')")
    page.context.set_offline(False)
    page.wait_for_selector(".waiting", state="detached")
    assert visit.trials() == 1
    assert visit.code()


def test_a_damaged_client_id_is_replaced(served: Served, page: Page) -> None:
    """The server refuses what is not a UUID, at each start of the page."""
    page.add_init_script(DAMAGED)
    assert go_through(page, served)


def test_blocked_cookies_in_chromium(served: Served, chromium: Browser, tmp_path: Path) -> None:
    """By the browser's own setting."""
    preferences = {
        "profile": {"default_content_setting_values": {"cookies": 2}, "block_third_party_cookies": True}
    }
    (tmp_path / "Default").mkdir()
    (tmp_path / "Default" / "Preferences").write_text(json.dumps(preferences), encoding="utf-8")
    context = chromium.browser_type.launch_persistent_context(
        str(tmp_path), executable_path=system_chromium(), args=CHROMIUM_FLAGS, headless=True, locale="en-GB"
    )
    try:
        page = context.new_page()
        page.goto(f"{served.server.address}/run/{served.studies['short'].link_token}")
        assert (
            page.evaluate("(() => { try { return !!window.localStorage; } catch { return 'denied'; } })()")
            == "denied"
        )
        assert go_through(page, served)
    finally:
        context.close()


def test_blocked_cookies_in_firefox(served: Served) -> None:
    firefox = next((path for name in ("firefox-esr", "firefox") if (path := shutil.which(name))), None)
    if firefox is None or not (REPOSITORY / "frontend" / "node_modules" / "puppeteer-core").is_dir():
        pytest.skip("no Firefox, or the frontend's packages are not installed: run `make setup-test`")
    address = f"{served.server.address}/run/{served.studies['practised'].link_token}"
    settings = json.dumps({"network.cookie.cookieBehavior": 2})
    command = ["node", "tests/firefox/visit.mjs", firefox, address, "", "0", settings]
    done = subprocess.run(
        command, cwd=REPOSITORY / "frontend", capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.strip().splitlines()[-1])["code"]
