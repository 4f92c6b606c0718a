"""A signed-in owner's browser on a real server with a short study and a few simulated visits."""

import random
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from fastapi.testclient import TestClient
from playwright.sync_api import Browser, ConsoleMessage, Page

from server.accounts import invitations
from server.app import create_app
from server.cli_common import migrated_services
from tests.browser.conftest import REPOSITORY
from tests.browser.forked_server import ForkedServer
from tests.browser.server_process import ServerProcess
from tests.helpers.admins import PASSWORD
from tests.helpers.studies import SHORT, Participant

PEOPLE = 4


@dataclass
class Dashboard:
    """The page, the server behind it, and what the browser complained of."""

    page: Page
    server: ServerProcess
    complaints: list[str]

    def open(self, path: str) -> Page:
        """Open an address of the admin site and wait until it is quiet."""
        self.page.goto(f"{self.server.address}/admin{path}")
        self.page.wait_for_load_state("load")
        self.page.get_by_role("heading").first.wait_for()
        return self.page


@pytest.fixture(scope="session")
def built_admin() -> None:
    """The built admin site; built here where it is missing."""
    if not (REPOSITORY / "frontend" / "dist" / "admin" / "index.html").is_file():
        if not (REPOSITORY / "frontend" / "node_modules").is_dir():
            pytest.skip(
                "the admin site is not built and its packages are not installed: run `make setup-test`"
            )
        subprocess.run(["npm", "run", "-s", "build:admin"], cwd=REPOSITORY / "frontend", check=True)


@pytest.fixture(scope="module")
def busy_server(built_admin: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server with the short study and four visits, three of them complete."""
    folder = tmp_path_factory.mktemp("admin")
    process = ForkedServer(folder / "data")
    study = process.add_study(folder / "clips", SHORT)
    chance = random.Random(1)
    with TestClient(create_app(process.settings)) as client:
        for number in range(PEOPLE):
            person = Participant(client, study.link_token).agree()
            trials = person.state()["trials"]
            for trial in trials if number else trials[:5]:
                asked = [int(letter) for letter in (trial["prompt"] or "") if letter.isdigit()]
                person.rate(trial, *(asked[:1] or [chance.randint(2, 7)]))
            if number:
                person.answer_forms()
                person.request("POST", "/complete")
    process.start()
    yield process
    process.stop()


@pytest.fixture(scope="module")
def dashboard(busy_server: ServerProcess, chromium: Browser) -> Iterator[Dashboard]:
    """The owner's browser, signed in through the page of a one-time link."""
    with migrated_services(busy_server.settings) as services:
        _, token = invitations.invite(services.database, "owner", "", None)
    context = chromium.new_context(viewport={"width": 1280, "height": 800}, locale="en-GB")
    page = context.new_page()
    found = Dashboard(page, busy_server, [])

    def note(message: ConsoleMessage) -> None:
        if message.type == "error":
            found.complaints.append(message.text)

    page.on("console", note)
    page.on("pageerror", lambda error: found.complaints.append(str(error)))
    page.goto(f"{busy_server.address}/admin/invitation#{token}")
    page.get_by_label("User name").fill("ada")
    page.locator("input[autocomplete=new-password]").fill(PASSWORD)
    page.get_by_role("button", name="Create account").click()
    page.get_by_role("heading", name="Studies").wait_for()
    yield found
    context.close()
