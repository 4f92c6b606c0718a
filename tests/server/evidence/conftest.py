"""A server that refuses, and a participant with evidence."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from tests.helpers.evidence import Watcher, services  # noqa: F401 - fixture
from tests.helpers.studies import StudyInDatabase, add_study

CLIP_FRAMES = 90
CLIP_S = CLIP_FRAMES / 30


@pytest.fixture
def study(services: Services, quick_folder: Path) -> StudyInDatabase:  # noqa: F811 - the fixture above
    """The short study with clips of three seconds."""
    return add_study(services, quick_folder / "clips", frames=CLIP_FRAMES)


@pytest.fixture
def watcher(client: TestClient, study: StudyInDatabase) -> Watcher:
    """A participant who has begun and holds tickets."""
    return Watcher(client, study.link_token).begin()
