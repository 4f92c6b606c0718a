"""`server simulate --as MANNER --json OUT`: what scripts may rely on, for every manner."""

import json
from pathlib import Path

import pytest
from sqlalchemy import select

from server.context import Services
from server.models import StudyRun
from server.participation.evidence import GUESSED_BY_CHANCE
from server.rehearsals.manners import MANNERS
from tests.helpers.databases import run_server_command
from tests.helpers.studies import SHORT, StudyInDatabase, add_study
from tests.server.evidence.conftest import CLIP_FRAMES

CHECKS = '[evidence.motion_checks]\nper_block = 5\nkinds = ["direction"]\nclips = 16\n\n'
STUDY = SHORT.replace("per_cell = 2", "per_cell = 6").replace("[trial]\n", f"{CHECKS}[trial]\n", 1)
EXPECTED = {
    "http": {"unlikely"},
    "http-slow": {"unlikely"},
    "script": {"unlikely"},
    "frames": {"unclear", "unlikely"},
    "flow": {"unclear", "unlikely"},
    "careless": {"unclear", "unlikely"},
    "assistive": {"unclear"},
    "honest": {"likely", "unclear"},
    "scripted": {"unclear", "unlikely"},
}
BY_LUCK = {"http-slow": "unclear", "assistive": "likely"}
PEOPLE = 2


@pytest.fixture
def study(services: Services, quick_folder: Path) -> StudyInDatabase:
    """Clips of three seconds, ten motion checks."""
    return add_study(services, quick_folder / "clips", STUDY, frames=CLIP_FRAMES)


def allowed(manner: str, signals: dict[str, float]) -> set[str]:
    """The verdicts on a run; of those who guess, one in a hundred is right as often as who sees."""
    lucky = manner in BY_LUCK and signals["motion_checks_guessed"] < GUESSED_BY_CHANCE
    return EXPECTED[manner] | ({BY_LUCK[manner]} if lucky else set())


def test_every_manner_has_an_expectation() -> None:
    assert set(EXPECTED) == set(MANNERS)


@pytest.mark.parametrize("manner", EXPECTED)
def test_a_manner_is_simulated_judged_and_written(
    services: Services, study: StudyInDatabase, tmp_path: Path, manner: str
) -> None:
    out = tmp_path / "runs.json"
    command = ("simulate", study.name, "--as", manner, "--participants", str(PEOPLE), "--at-once", "1")
    command += ("--json", str(out))
    called = run_server_command(services.settings, *command)
    assert (called.returncode, called.stderr) == (0, "")
    assert f"{PEOPLE} as {manner}" in called.stdout
    runs = json.loads(out.read_text(encoding="utf-8"))["runs"]
    assert len(runs) == PEOPLE
    assert all(run["verdict"] in allowed(manner, run["signals"]) for run in runs)
    if manner == "honest":  # one person in a hundred may be doubted, not both of two
        assert "likely" in {run["verdict"] for run in runs}
    with services.database.read() as session:
        stored = {run.public_id: run.origin for run in session.scalars(select(StudyRun))}
    assert stored == {run["run"]: "simulated" for run in runs}
    assert all({"tickets", "trusted", "motion_checks_guessed"} <= set(run["signals"]) for run in runs)


def test_an_unknown_manner_is_one_clear_line(services: Services, study: StudyInDatabase) -> None:
    called = run_server_command(services.settings, "simulate", study.name, "--as", "htp")
    assert called.returncode != 0
    assert "there is no behavior 'htp'" in called.stderr
    assert "http" in called.stderr
    assert "Traceback" not in called.stderr
