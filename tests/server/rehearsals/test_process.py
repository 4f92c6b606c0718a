"""The process of a rehearsal: one at a time, gone with all that it started, in place of the one before."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from server.accounts.identity import OPERATOR, Identity
from server.context import Services
from server.core.errors import Conflict
from server.models import Account, Job
from server.rehearsals import service
from server.rehearsals.schemas import NewRehearsal
from server.results.jobs import begin_job
from server.studies.lookup import find_study
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, StudyInDatabase, add_study
from tests.helpers.waiting import until

PATH = "/studies/short/rehearsals"
ENDS = "raise SystemExit(0)"
BEGINS_A_CHILD = """
import subprocess, sys
from pathlib import Path
hangs = [sys.executable, "-c", "import time; time.sleep(600)"]
child = subprocess.Popen(hangs, stdout=subprocess.DEVNULL)
path = Path(sys.argv[1], "child")
path.with_suffix(".new").write_text(str(child.pid))
path.with_suffix(".new").rename(path)
"""
HOLDS = """
import fcntl, sys
lock = open(sys.argv[1], "a")
fcntl.flock(lock, fcntl.LOCK_EX)
print(flush=True)
sys.stdin.read()
"""
HANGS = BEGINS_A_CHILD + "child.wait()"
LASTS = """
import sys, time
from pathlib import Path
folder = Path(sys.argv[1])
(folder.parent / f"{folder.name}.begun").touch()
while not (folder.parent / "go").exists():
    time.sleep(0.02)
"""


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """A real process with this text runs in the place of the rehearsal."""

    def run(text: str) -> None:
        monkeypatch.setattr(service, "_program", lambda folder: [sys.executable, "-c", text, str(folder)])

    return run


def latest(admin: Admin, study: str = "short") -> Any:
    return admin.get(f"/studies/{study}/rehearsals/latest").json()


def is_over(admin: Admin, study: str = "short") -> bool:
    return latest(admin, study)["status"] not in ("queued", "running")


def folder_of(services: Services) -> Path:
    return services.settings.data_folder / "rehearsals"


def is_gone(process: int) -> bool:
    """Whether no such process runs: ended, or ended and not yet collected by its parent."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    status = Path(f"/proc/{process}/stat")
    return status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] == "Z"


@pytest.mark.parametrize(
    ("text", "limits_s", "status"), [(HANGS, (2, 8, 32), "failed"), (BEGINS_A_CHILD, (600,), "done")]
)
def test_nothing_that_a_rehearsal_started_outlives_it(
    services: Services,
    experimenter: Admin,
    study: StudyInDatabase,
    program: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
    text: str,
    limits_s: tuple[float, ...],
    status: str,
) -> None:
    """Its time is over while a child of its hangs; or it ends and leaves one behind."""
    program(text)
    for limit_s in limits_s:  # a slow machine may need longer until there is a child
        monkeypatch.setattr(service, "LONGEST_S", limit_s)
        public_id = experimenter.send("POST", PATH, {}).json()["id"]
        until(lambda: is_over(experimenter))
        assert latest(experimenter)["status"] == status
        if (child := folder_of(services) / public_id / "child").exists():
            break
    process = int(child.read_text())
    until(lambda: is_gone(process))


def test_a_rehearsal_takes_the_place_of_the_one_before(
    services: Services, experimenter: Admin, study: StudyInDatabase, program: Callable[[str], None]
) -> None:
    program(ENDS)
    first = experimenter.send("POST", PATH, {}).json()
    until(lambda: is_over(experimenter))
    assert (folder_of(services) / first["id"]).is_dir()
    assert experimenter.send("POST", PATH, {"participants": 0}).status_code == 422
    assert (latest(experimenter)["id"], (folder_of(services) / first["id"]).is_dir()) == (first["id"], True)
    second = experimenter.send("POST", PATH, {}).json()
    until(lambda: is_over(experimenter))
    assert latest(experimenter)["id"] == second["id"] != first["id"]
    assert [path.name for path in folder_of(services).iterdir() if path.is_dir()] == [second["id"]]
    with services.database.read() as session:
        assert session.query(Job).count() == 1


def test_a_rehearsal_waits_for_that_of_another_study(
    services: Services,
    owner: Admin,
    study: StudyInDatabase,
    program: Callable[[str], None],
    tmp_path: Path,
) -> None:
    add_study(services, tmp_path / "other", SHORT.replace('name = "short"', 'name = "other"', 1))
    program(LASTS)
    one = owner.send("POST", PATH, {}).json()["id"]
    until((folder_of(services) / f"{one}.begun").exists)
    other = owner.send("POST", "/studies/other/rehearsals", {}).json()["id"]
    until((folder_of(services) / other / "order.json").exists)
    time.sleep(0.5)  # what does not wait begins meanwhile
    assert (latest(owner)["status"], latest(owner, "other")["status"]) == ("running", "queued")
    assert not (folder_of(services) / f"{other}.begun").exists()
    (folder_of(services) / "go").touch()
    until(lambda: is_over(owner) and is_over(owner, "other"))
    assert (latest(owner)["status"], latest(owner, "other")["status"]) == ("done", "done")


def test_a_rehearsal_is_cancelled_with_all_that_it_started(
    services: Services, experimenter: Admin, study: StudyInDatabase, program: Callable[[str], None]
) -> None:
    program(HANGS)
    public_id = experimenter.send("POST", PATH, {}).json()["id"]
    child = folder_of(services) / public_id / "child"
    until(child.exists)
    assert experimenter.send("POST", f"{PATH}/{public_id}/cancel", {}).status_code == 204
    assert latest(experimenter)["status"] == "cancelled"
    process = int(child.read_text())
    until(lambda: is_gone(process))
    assert experimenter.send("POST", f"{PATH}/{public_id}/cancel", {}).status_code == 204
    assert experimenter.send("POST", f"{PATH}/another/cancel", {}).status_code == 404
    program(ENDS)
    experimenter.send("POST", PATH, {})
    until(lambda: is_over(experimenter))
    assert latest(experimenter)["status"] == "done"


def test_one_that_was_replaced_before_it_had_a_folder_never_begins(
    services: Services, experimenter: Admin, study: StudyInDatabase, program: Callable[[str], None]
) -> None:
    program(BEGINS_A_CHILD)
    service._run(services.database, services.settings, "short", "replaced", NewRehearsal())
    assert not (folder_of(services) / "replaced").exists()


def test_a_rehearsal_waits_for_one_in_another_process_of_the_server(
    services: Services, experimenter: Admin, study: StudyInDatabase, program: Callable[[str], None]
) -> None:
    """It can be cancelled meanwhile, and never begins."""
    program(ENDS)
    lock = folder_of(services) / ".one-at-a-time"
    lock.parent.mkdir(parents=True, exist_ok=True)
    with subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(lock)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as other:  # fmt: skip
        assert other.stdout is not None
        assert other.stdin is not None
        other.stdout.readline()
        public_id = experimenter.send("POST", PATH, {}).json()["id"]
        until((folder_of(services) / public_id / "order.json").exists)
        assert latest(experimenter)["status"] == "queued"
        experimenter.send("POST", f"{PATH}/{public_id}/cancel", {})
        assert latest(experimenter)["status"] == "cancelled"
        second = experimenter.send("POST", PATH, {}).json()["id"]
        until((folder_of(services) / second / "order.json").exists)
        assert latest(experimenter)["status"] == "queued"
        other.stdin.close()
    until(lambda: is_over(experimenter))
    assert latest(experimenter)["status"] == "done"


def test_of_two_who_ask_at_once_one_is_refused(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    """The second looks before the first has committed: it has to wait for the study."""
    outcomes: list[str] = []
    with services.database.read() as session:
        account = session.query(Account).one()
        somebody = Identity(account.id, account.name, account.role)

    def ask() -> None:
        try:
            with services.database.write() as session:
                asked = find_study(session, "short", OPERATOR, "run")
                begin_job(services.locks, session, asked, "rehearsal", {}, somebody, "it goes on already")
            outcomes.append("begun")
        except Conflict as error:
            outcomes.append(str(error))

    second = threading.Thread(target=ask)
    with services.database.write() as session:
        first = find_study(session, "short", OPERATOR, "run")
        begin_job(services.locks, session, first, "rehearsal", {}, somebody, "it goes on already")
        session.flush()
        second.start()
        second.join(0.5)
    second.join(60)
    assert outcomes == ["it goes on already"]
