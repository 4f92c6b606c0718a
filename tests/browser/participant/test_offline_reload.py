"""The page is loaded again without a connection, or without a server: the run goes on where it was."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.browser.server_process import ServerProcess
from tests.browser.studies import PLAIN, without
from tests.browser.visit import Visit

pytestmark = pytest.mark.browser
RATED = "SELECT trial_index, play, response FROM ratings WHERE kind = 'main' ORDER BY time_elapsed"
EVENTS = "SELECT type, data FROM run_events"
READY = """Promise.race([
  navigator.serviceWorker.ready.then(worker => worker.active !== null),
  new Promise(late => setTimeout(() => late(false), 20_000)),
])"""
Change = Callable[[Page, ServerProcess], None]


def under_way(server: ServerProcess, folder: Path, page: Page, declared: str = PLAIN) -> tuple[Visit, str]:
    """Two trials of six are rated and acknowledged, and the page has been kept."""
    study = server.add_study(folder, declared)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    visit.trials(most=2)
    page.wait_for_selector(".ready")
    assert len(server.rows_soon(RATED, 2)) == 2
    assert page.evaluate(READY)
    return visit, study.link_token


def off_line(page: Page, _server: ServerProcess) -> None:
    page.context.set_offline(True)


def on_line(page: Page, _server: ServerProcess) -> None:
    page.context.set_offline(False)


def killed(_page: Page, server: ServerProcess) -> None:
    server.kill()


def started(_page: Page, server: ServerProcess) -> None:
    server.start()


@pytest.mark.parametrize(("lose", "restore"), [(off_line, on_line), (killed, started)])
def test_a_reload_without_a_server_goes_on_at_the_next_trial(
    server: ServerProcess, tmp_path: Path, page: Page, lose: Change, restore: Change
) -> None:
    visit, _ = under_way(server, tmp_path / "clips", page)
    lose(page, server)
    visit.rate("2")
    page.wait_for_selector(".ready, .break")
    page.reload()
    page.wait_for_selector("text=Welcome back")
    assert "3 of 6" in page.inner_text(".prose")
    visit.instructions()
    visit.trials(most=2, key="3")
    page.reload()  # once more, with nothing of the second visit acknowledged either
    page.wait_for_selector("text=Welcome back")
    assert "5 of 6" in page.inner_text(".prose")
    restore(page, server)
    visit.instructions()
    assert visit.trials(key="5") == 1
    rows = server.rows(RATED)
    assert [row["response"] for row in rows] == [4, 4, 2, 3, 3, 5]
    assert len({row["trial_index"] for row in rows}) == 6
    assert [row["status"] for row in server.rows("SELECT status FROM study_runs")] == ["complete"]
    assert server.rows_soon(f"{EVENTS} WHERE data LIKE '%loaded_without_server%'", 1)
    assert page.evaluate("Object.keys(localStorage).filter(key => key.startsWith('palpebra visit'))") == []


def test_a_clip_that_failed_before_the_reload_is_still_shown_again(
    server: ServerProcess, tmp_path: Path, page: Page
) -> None:
    study = server.add_study(tmp_path / "clips", PLAIN, frames=30)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    page.wait_for_selector(".ready")
    page.keyboard.press(" ")
    page.wait_for_timeout(200)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    page.wait_for_selector(".scale")
    page.keyboard.press("3")
    page.wait_for_selector(".ready")
    assert len(server.rows_soon(RATED, 1)) == 1
    assert page.evaluate(READY)
    page.context.set_offline(True)
    page.reload()
    page.wait_for_selector("text=Welcome back")
    visit.instructions()
    visit.trials(most=3)
    page.context.set_offline(False)
    visit.trials()
    plays: dict[int, list[tuple[int, int]]] = {}
    for row in server.rows(RATED):
        plays.setdefault(row["trial_index"], []).append((row["play"], row["response"]))
    # On a machine under load others may fail by themselves, and are shown again too.
    failed, *others = sorted(plays.values())
    assert failed == [(1, 3), (2, 4)]
    assert [each[0] for each in others] == [(1, 4)] * 5


@pytest.mark.parametrize("policy", ["restart", "block"])
def test_where_the_study_must_be_asked_a_reload_waits_for_the_server(
    server: ServerProcess, tmp_path: Path, page: Page, policy: str
) -> None:
    declared = without(PLAIN, ("[practice]", f'[session]\nresume = "{policy}"\n\n[practice]'))
    study = server.add_study(tmp_path / "clips", declared)
    server.start()
    visit = Visit(page, server.address).open(study.link_token).begin().instructions().practice()
    visit.trials(most=1)
    assert page.evaluate("navigator.serviceWorker.getRegistrations().then(all => all.length)") == 0
    assert page.evaluate("Object.keys(localStorage).filter(key => key.startsWith('palpebra visit'))") == []
    visit.open(study.link_token)
    if policy == "block":
        page.wait_for_selector("text=must be completed without interruption")
        assert len(server.rows("SELECT 1 FROM study_runs")) == 1
    else:
        page.wait_for_selector(".page > .tick")


def test_an_answer_of_the_server_is_never_made_up(server: ServerProcess, tmp_path: Path, page: Page) -> None:
    visit, link = under_way(server, tmp_path / "clips", page)
    visit.open(link)  # this load is served by the worker
    page.wait_for_selector("text=Welcome back")
    kept = page.evaluate(
        """async () => {
          const found = [];
          for (const name of await caches.keys()) found.push(...(await (await caches.open(name)).keys()));
          return found.map(request => new URL(request.url).pathname);
        }"""
    )
    assert kept
    assert all(path == "/run/offline" or path.startswith("/assets/participant/") for path in kept)
    page.context.set_offline(True)
    asked = "path => fetch(path).then(answer => answer.status, () => 'no answer')"
    assert page.evaluate(asked, f"/api/links/{link}") == "no answer"
