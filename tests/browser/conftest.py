"""A real server, a real Chromium, and the built page."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from tests.browser.forked_server import ForkedServer
from tests.browser.server_process import ServerProcess

REPOSITORY = Path(__file__).resolve().parents[2]
CHROMIUM_NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

# As long as Playwright waits for everything else; 5 s by itself, which a busy machine takes for a page.
expect.set_options(timeout=30_000)


@pytest.fixture(scope="session")
def built_page() -> Path:
    """The folder of the built participant page; built here where it is missing."""
    folder = REPOSITORY / "frontend" / "dist" / "participant"
    if not (folder / "index.html").is_file():
        if not (REPOSITORY / "frontend" / "node_modules").is_dir():
            pytest.skip("the page is not built and its packages are not installed: run `make setup-test`")
        subprocess.run(["npm", "run", "-s", "build:participant"], cwd=REPOSITORY / "frontend", check=True)
    return folder


def system_chromium() -> str | None:
    """The path of the system's Chromium; None where Playwright's own is to be used."""
    return next((path for name in CHROMIUM_NAMES if (path := shutil.which(name))), None)


@pytest.fixture
def server(tmp_path: Path, built_page: Path) -> Iterator[ServerProcess]:
    """A server process with its own data folder, not yet started, so that studies can be added."""
    process = ForkedServer(tmp_path / "data")
    yield process
    process.stop()


@pytest.fixture
def context(chromium: Browser) -> Iterator[BrowserContext]:
    """A fresh profile, as a new participant has it."""
    opened = chromium.new_context(viewport={"width": 1280, "height": 800}, locale="en-GB")
    yield opened
    opened.close()


@pytest.fixture
def page(context: BrowserContext) -> Page:
    """A page whose errors fail the test that looks at `page_errors(page)`."""
    return context.new_page()
