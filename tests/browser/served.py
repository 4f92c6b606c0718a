"""One server for many tests: its studies are made before it starts; each test asks for its own run alone."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

from tests.browser.forked_server import ForkedServer
from tests.browser.server_process import ServerProcess
from tests.browser.studies import without
from tests.browser.visit import Visit
from tests.helpers.studies import StudyInDatabase

LATEST_RUN = "(SELECT max(id) FROM study_runs)"


@dataclass(frozen=True)
class Served:
    """A running server and its studies by name."""

    server: ServerProcess
    studies: dict[str, StudyInDatabase]

    def visit(self, study: str, page: Page) -> Visit:
        """A new visit in front of its first trial, of a study without practice."""
        return self.visit_by(self.studies[study].link_token, page)

    def visit_by(self, link: str, page: Page) -> Visit:
        """The same by any link."""
        visit = Visit(page, self.server.address).open(link).begin().instructions()
        page.wait_for_selector(".ready")
        return visit

    def rows_of_latest(self, view: str, order: str, count: int = 0) -> list[dict[str, Any]]:
        """Rows of an export's view for the run begun last, once there are `count`."""
        run = f"(SELECT public_id FROM study_runs WHERE id = {LATEST_RUN})"
        statement = f"SELECT * FROM {view} WHERE run = {run} ORDER BY {order}"
        return self.server.rows_soon(statement, count)

    def views(self, count: int = 0) -> list[dict[str, Any]]:
        """The ledger's rows for the run begun last, once there are `count`."""
        statement = f"SELECT * FROM views WHERE study_run_id = {LATEST_RUN} ORDER BY id"
        return self.server.rows_soon(statement, count)


@contextmanager
def serve(folder: Path, studies: Mapping[str, tuple[str, int]], **settings: str) -> Iterator[Served]:
    """A server with studies: by name a declaration (called `browser` in itself) and the frames of a clip."""
    server = ForkedServer(folder / "data", **settings)
    made = {}
    for name, (declared, frames) in studies.items():
        own = without(declared, ('name = "browser"', f'name = "{name}"'))
        made[name] = server.add_study(folder / name, own, frames)
    try:
        yield Served(server.start(), made)
    finally:
        server.stop()


def start_clip(page: Page) -> None:
    """Press the start key; back once the clip's place says that it plays."""
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".trial.playing")


def show_to_answers(page: Page) -> None:
    """Press the start key; back once the buttons of a choice are there."""
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_selector(".pair-answers")


def reload_in_next_clip(page: Page, after_ms: int = 300) -> None:
    """The page reloads in the midst of its next clip.

    By the page itself: on a slow machine the clip may be over before word of it has come here and back.
    """
    page.evaluate(
        """after_ms => new MutationObserver(() => {
            if (document.querySelector(".trial.playing")) setTimeout(() => location.reload(), after_ms);
        }).observe(document.body, { subtree: true, attributes: true })""",
        after_ms,
    )


def go_back(page: Page) -> None:
    """From the page that says welcome back to the trials."""
    page.wait_for_selector(".prose h1, .prose h2")
    page.click(".primary")
