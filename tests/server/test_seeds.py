"""The seed that a test asks for is the one its runs have."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.models import StudyRun
from tests.helpers.seeds import ONE_SEED
from tests.helpers.studies import Participant, add_study


def begun(client: TestClient, services: Services, folder: Path) -> list[int]:
    """Seeds of two runs of a small study, as the database has them."""
    study = add_study(services, folder / "clips")
    for _ in range(2):
        Participant(client, study.link_token).agree()
    with services.database.read() as session:
        return [run.seed for run in session.query(StudyRun)]


@pytest.mark.usefixtures("one_seed")
def test_one_seed_reaches_every_run(client: TestClient, services: Services, tmp_path: Path) -> None:
    assert begun(client, services, tmp_path) == [ONE_SEED, ONE_SEED]


def test_runs_have_seeds_of_their_own(client: TestClient, services: Services, tmp_path: Path) -> None:
    first, second = begun(client, services, tmp_path)
    assert first != second
