"""What is found before a study goes live."""

from pathlib import Path

from experiments.level_leaks import reported_leaks
from experiments.manifest import Manifest
from server.context import Services
from server.models import StudyVersion
from tests.helpers.admins import Admin
from tests.helpers.studies import add_study


def test_levels_told_apart_by_something_else_are_named_before_going_live(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", status="draft")
    assert owner.get("/studies/short/launch-checks").json() == []
    with services.database.write() as session:
        version = session.query(StudyVersion).one()
        clips = [
            clip | {"closure": [0.0, 1.0, 0.0 if clip["levels"]["speed"] == "slow" else 0.1]}
            for clip in version.manifest["clips"]
        ]
        version.manifest = version.manifest | {"clips": clips}
        expected = reported_leaks(Manifest.model_validate(version.manifest).clips)
    answer = owner.get("/studies/short/launch-checks").json()
    assert expected
    assert [check["text"].lower() for check in answer] == [f"{text}.".lower() for text in expected]
    assert all("'speed'" in check["text"] and not check["blocks"] for check in answer)
