"""The demonstrations of each kind of trial, answered by simulated people, from Results to their analysis."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from playwright.sync_api import expect
from typer.testing import CliRunner

from analysis.cli import app
from experiments.errors import counted
from experiments.load import load_experiment, locate
from server.app import create_app
from server.rehearsals.person import Person, Rater
from tests.browser.admin.conftest import Dashboard
from tests.browser.admin.test_walk import shoot
from tests.browser.forked_server import ForkedServer
from tests.browser.server_process import ServerProcess
from tests.browser.visit import axe_violations
from tests.helpers.simulated import Api

pytestmark = pytest.mark.browser
PEOPLE = {"pairs-demo": 3, "sliders-demo": 2, "threshold-demo": 1, "timing-continuous": 2}
DEMOS = tuple(PEOPLE)
FRAMES = {"timing-continuous": 60}
"""Of each clip; two are enough for answers that come after it."""
LABELS = {
    "pairs-demo": "Photorealistic, From the model",
    "sliders-demo": "Photorealistic",
    "threshold-demo": "Closes faster than it opens",
    "timing-continuous": "Locked to events",
}
WIDE = """() => document.documentElement.scrollWidth > 390
  ? [`the page is ${document.documentElement.scrollWidth} px wide`] : []"""
# Texts of figures that leave their figure, or of which one covers more than a rim of another.
COVERED = """() => [...document.querySelectorAll('.plot svg:not([class*=ramp])')].flatMap((figure) => {
  const frame = figure.getBoundingClientRect(), rim = 4;
  const texts = [...figure.querySelectorAll('text')].filter((one) => one.textContent.trim());
  const boxes = texts.map((one) => [one.textContent, one.getBoundingClientRect()]);
  const outside = boxes.filter(([, box]) => box.left < frame.left - 1 || box.right > frame.right + 1);
  const covers = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > rim &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > rim;
  const over = boxes.flatMap(([one, a], i) =>
    boxes.slice(i + 1).filter(([, b]) => covers(a, b)).map(([other]) => one + ' and ' + other));
  return [...outside.map(([text]) => 'outside: ' + text), ...over];
})"""


@pytest.fixture(scope="module")
def busy_server(built_admin: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server with the three demonstrations, each answered by simulated people alone."""
    folder = tmp_path_factory.mktemp("kinds")
    process = ForkedServer(folder / "data")
    with TestClient(create_app(process.settings)) as client:
        for demo, people in PEOPLE.items():
            study = process.add_study(
                folder / demo, locate(demo).read_text(encoding="utf-8"), frames=FRAMES.get(demo, 2)
            )
            link = process.link(study, "general", synthetic=True)
            for number in range(people):
                person = Person(Api(client), Rater(number, 1, {}))
                assert person.take_part(link)
    process.start()
    yield process
    process.stop()


@pytest.mark.parametrize("demo", DEMOS)
def test_results_say_whose_answers_there_are_and_show_them_by_label(dashboard: Dashboard, demo: str) -> None:
    dashboard.complaints.clear()
    page = dashboard.open(f"/studies/{load_experiment(demo).name}/results")
    runs = counted(PEOPLE[demo], "run")
    expect(page.get_by_text(f"participants yet, only from simulated people ({runs})")).to_be_visible()
    page.get_by_role("button", name="Show simulated").click()
    expect(page.get_by_text("no person gave these answers")).to_be_visible()
    expect(page.get_by_text(LABELS[demo]).first).to_be_visible()
    assert axe_violations(page) == []
    page.set_viewport_size({"width": 390, "height": 844})
    try:
        faults = ["not looked at"]
        # Figures are drawn again for the narrower page, a moment after it has become so.
        for _ in range(50):
            faults = [*page.evaluate(WIDE), *page.evaluate(COVERED)]
            if not faults:
                break
            page.wait_for_timeout(200)
        shoot(dashboard, f"results-{demo}-narrow")
        assert faults == []
    finally:
        page.set_viewport_size({"width": 1280, "height": 800})
    assert dashboard.complaints == []


@pytest.mark.parametrize("demo", DEMOS)
def test_the_analysis_finds_the_study_and_its_declaration_by_name(
    busy_server: ServerProcess, tmp_path: Path, demo: str
) -> None:
    options = ["--database", busy_server.settings.resolved_database_url, "--no-report"]
    done = CliRunner().invoke(app, ["run", load_experiment(demo).name, *options])
    assert done.exit_code == 0, done.output
    assert "synthetic" in done.output.lower() or "simulated" in done.output.lower()
