"""Capsules go: by the button, by their number and by their age; what is being made stays."""

from datetime import timedelta
from pathlib import Path

from server.context import Services
from server.core.values import now
from server.exports.capsules import remove_old
from server.models import Job
from tests.helpers.admins import Admin
from tests.helpers.studies import StudyInDatabase

PATH = "/studies/short/capsules"


def add(services: Services, number: int, status: str = "done", days: float = 0.0) -> Path:
    """A capsule of this age; its zip."""
    public_id = f"{number:032x}"
    with services.database.write() as session:
        known = {"kind": "capsule", "study_id": 1, "status": status, "message": ""}
        session.add(Job(public_id=public_id, created_at=now() - timedelta(days=days), **known))
    path = services.settings.data_folder / "capsules" / f"{public_id}.zip"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"a capsule")
    return path


def numbers(admin: Admin) -> list[int]:
    return [int(capsule["id"], 16) for capsule in admin.get(PATH).json()]


def test_a_capsule_is_deleted_with_its_zip(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    path = add(services, 1)
    assert experimenter.send("DELETE", f"{PATH}/{1:032x}").status_code == 204
    assert (path.exists(), numbers(experimenter)) == (False, [])
    assert experimenter.send("DELETE", f"{PATH}/{1:032x}").status_code == 404


def test_a_capsule_that_is_being_made_is_left_alone(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    path = add(services, 1, "running")
    refused = experimenter.send("DELETE", f"{PATH}/{1:032x}")
    assert (refused.status_code, path.exists()) == (409, True)
    remove_old(services.database, services.settings, services.locks, "short")
    assert numbers(experimenter) == [1]


def test_too_many_and_too_old_ones_go_when_another_is_done(
    services: Services, experimenter: Admin, owner: Admin, study: StudyInDatabase
) -> None:
    paths = [add(services, number, days=100 if number in (6, 7) else 0) for number in range(1, 9)]
    remove_old(services.database, services.settings, services.locks, "short")
    assert numbers(experimenter) == [8, 5, 4, 3, 2]
    assert [path.exists() for path in paths] == [False, True, True, True, True, False, False, True]
    removed = [entry for entry in owner.get("/audit").json() if entry["action"] == "capsule removed"]
    assert len(removed) == 3


def test_attempts_that_failed_push_no_capsule_out(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    """They hold nothing to be downloaded, so they take nobody's place; they go by their age."""
    paths = [add(services, number) for number in range(1, 6)]
    for number in range(6, 12):
        add(services, number, "failed", days=100 if number == 6 else 0)
    add(services, 12, "running", days=1)
    remove_old(services.database, services.settings, services.locks, "short")
    assert numbers(experimenter) == [12, 11, 10, 9, 8, 7, 5, 4, 3, 2, 1]
    assert all(path.exists() for path in paths)


def test_attempts_that_failed_hide_no_capsule(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    add(services, 1)
    for number in range(2, 27):
        add(services, number, "failed")
    assert numbers(experimenter) == [*range(26, 6, -1), 1]
