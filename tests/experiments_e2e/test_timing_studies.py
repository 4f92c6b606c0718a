"""The studies of timing as they ship, answered by simulated people, and their analysis of what is stored."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from analysis.cli import app
from experiments.load import load_experiment, locate
from server.app import create_app
from server.context import Services
from server.core.settings import Settings
from server.rehearsals.person import Person, Rater
from tests.helpers.simulated import Api
from tests.helpers.studies import add_study

PEOPLE = {"timing": 6, "timing-continuous": 3, "timing-pairs": 4}
FRAMES = 60


@pytest.mark.parametrize("name", PEOPLE)
def test_the_stored_answers_are_analysed_as_declared(
    services: Services, settings: Settings, tmp_path: Path, name: str
) -> None:
    experiment = load_experiment(name)
    study = add_study(
        services, tmp_path / "clips", locate(name).read_text(encoding="utf-8"), experiment.name, frames=FRAMES
    )
    link = study.link(synthetic=True)
    with TestClient(create_app(settings)) as client:
        for number in range(PEOPLE[name]):
            assert Person(Api(client), Rater(number, 1, {})).take_part(link)
    out = tmp_path / "report"
    options = ["--database", settings.resolved_database_url, "--origin", "simulated", "--out", str(out)]
    done = CliRunner().invoke(app, ["run", experiment.name, *options])
    assert done.exit_code == 0, done.output
    report = (out / "report.html").read_text(encoding="utf-8")
    for level in ("Uniform timer", "Fitted intervals", "Locked to events", "No blinks"):
        assert level in report
