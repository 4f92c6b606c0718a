"""Two real hosts on one PostgreSQL, one object store and one shared folder: what must hold across both."""

import json
import time
import uuid
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2 as httpx
import pytest
from sqlalchemy import URL, text

from server.accounts import invitations
from server.context import Services, open_services
from server.core.migrate import upgrade
from server.core.storage import open_s3
from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.helpers.admins import PASSWORD
from tests.helpers.databases import database_of_its_own
from tests.helpers.hosts import Host, running, settings_of
from tests.helpers.studies import StudyInDatabase, add_study
from tests.helpers.videos import write_video

moto_server = pytest.importorskip("moto.server", reason="moto is not installed")
ADMIN = "/api/admin"
LOGINS_PER_MINUTE = 12
PATIENCE_S = 300.0
pytestmark = [
    pytest.mark.postgres,
    # boto3 announces the end of its support for this Python; requirements say 3.11.
    pytest.mark.filterwarnings("ignore::boto3.exceptions.PythonDeprecationWarning"),
    pytest.mark.filterwarnings("ignore:datetime.datetime.utcnow:DeprecationWarning"),
]


@pytest.fixture(scope="module")
def store() -> Iterator[str]:
    server = moto_server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture(scope="module")
def services(
    postgres_server: URL, store: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Services]:
    """The operator's hands on the same database and store."""
    with pytest.MonkeyPatch.context() as patched, database_of_its_own(postgres_server) as url:
        patched.setenv("AWS_ACCESS_KEY_ID", "test")
        patched.setenv("AWS_SECRET_ACCESS_KEY", "test")
        folder = tmp_path_factory.mktemp("hosts")
        settings = settings_of(folder, "operator", url, store, logins_per_minute=LOGINS_PER_MINUTE)
        client = open_s3(settings).client
        client.create_bucket(Bucket="clips")
        client.close()
        opened = open_services(settings)
        upgrade(opened.database)
        yield opened
        opened.database.close()


@pytest.fixture(scope="module")
def study(services: Services, tmp_path_factory: pytest.TempPathFactory) -> StudyInDatabase:
    return add_study(services, tmp_path_factory.mktemp("clips"))


@pytest.fixture(scope="module")
def hosts(services: Services, study: StudyInDatabase) -> Iterator[tuple[Host, Host]]:
    with host(services, "a") as one, host(services, "b") as other:
        yield one, other


@contextmanager
def host(services: Services, name: str) -> Iterator[Host]:
    """A host with its own data folder."""
    folder = services.settings.data_folder.with_name(name)
    with running(services.settings.model_copy(update={"data_folder": folder})) as started:
        yield started


@pytest.fixture(scope="module")
def owner(services: Services, hosts: tuple[Host, Host]) -> list[httpx.Client]:
    """One owner's browser at each host; she signed in at the first."""
    _, token = invitations.invite(services.database, "owner", "", None)
    first, other = (one.browser() for one in hosts)
    made = first.post(f"{ADMIN}/invitations/{token}/account", json={"name": "ada", "password": PASSWORD})
    assert made.status_code == 201, made.text
    other.cookies.update(first.cookies)
    return [first, other]


def test_a_stream_on_one_host_shows_what_the_other_wrote(
    study: StudyInDatabase, hosts: tuple[Host, Host], owner: list[httpx.Client]
) -> None:
    with owner[0].stream("GET", f"{ADMIN}/studies/short/monitor/stream") as stream:
        events = (json.loads(line[6:]) for line in stream.iter_lines() if line.startswith("data: "))
        assert next(events)["total"] == 0
        time.sleep(3)  # quiet: without word from the other host the next look is seven seconds off
        person = Visit(hosts[1], study)
        began = time.monotonic()
        shown = next(event for event in events if event["total"])
        assert len(shown["runs"]) == 1
        assert time.monotonic() - began < 5
    person.client.close()


class Visit:
    """A visit that one person makes by whatever host answers."""

    def __init__(self, host: Host, study: StudyInDatabase, number: int = 1) -> None:
        self.client = JsonClient(host.address)
        self.person = Person(self.client, Rater(number, 1, {}))
        self.person.begin(study.link_token)
        self.client.put("/api/run/consent", {"agreed": True})
        self.state = self.client.get("/api/run")

    def rate(self, trial: dict[str, Any]) -> str:
        """Rate a trial; the id of the acknowledged rating."""
        ident = str(uuid.uuid4())
        body = self.person.rating(trial, self.state["trial"])
        return str(self.client.put(f"/api/run/ratings/{ident}", body)["receipt"]["rating_id"])

    def move_to(self, host: Host) -> None:
        """Go on by another host, with the same token."""
        token = self.client.token
        self.client.close()
        self.client = self.person.client = JsonClient(host.address)
        self.client.token = token


def soon(ask: Any, wanted: Any) -> Any:
    """The result of `ask` once it is as `wanted`."""
    until = time.monotonic() + PATIENCE_S
    while not wanted(answer := ask()):
        assert time.monotonic() < until, answer
        time.sleep(0.2)
    return answer


def test_a_capsule_is_made_once_and_handed_out_by_every_host(
    study: StudyInDatabase, hosts: tuple[Host, Host], owner: list[httpx.Client]
) -> None:
    one, other = owner
    for number in range(4):  # enough for a report
        visit = Visit(hosts[number % 2], study, number)
        for trial in visit.state["trials"]:
            visit.rate(trial)
        visit.client.close()
    order = {"clips": True}
    assert one.post(f"{ADMIN}/studies/short/capsules", json=order).status_code == 202
    again = other.post(f"{ADMIN}/studies/short/capsules", json=order)
    assert (again.status_code, again.json()["error"]["code"]) == (409, "conflict")
    [made] = soon(
        lambda: other.get(f"{ADMIN}/studies/short/capsules").json(),
        lambda listed: listed[0]["status"] not in ("queued", "running"),
    )
    assert (made["status"], made["message"]) == ("done", "")
    zips = [
        browser.get(f"{ADMIN}/studies/short/capsules/{made['id']}.zip").content for browser in (one, other)
    ]
    assert zips[0] == zips[1]
    assert len(zips[0]) == made["bytes"]


def test_an_upload_goes_on_by_another_host_and_is_converted_once(
    services: Services, owner: list[httpx.Client], tmp_path: Path
) -> None:
    one, other = owner
    names = [f"clip_{number}.mp4" for number in range(4)]
    contents = [write_video(tmp_path / name, frames=20).read_bytes() for name in names]
    upload = one.post(f"{ADMIN}/uploads", files=[("files", (names[0], contents[0]))]).json()["id"]
    for name, content in zip(names[1:], contents[1:], strict=True):
        sent = other.post(f"{ADMIN}/uploads/{upload}/files", files=[("files", (name, content))])
        assert sent.status_code == 200, sent.text
    for browser in (one, other):
        soon(
            lambda browser=browser: browser.get(f"{ADMIN}/uploads/{upload}/progress").json(),
            lambda told: not told["waiting"],
        )
    folder = services.settings.upload_folder / upload
    records = [json.loads(line)["name"] for line in (folder / ".prepared").read_text().splitlines()]
    assert sorted(records) == names


def test_a_host_that_is_lost_loses_no_rating_and_leaves_no_lock(
    services: Services, study: StudyInDatabase, hosts: tuple[Host, Host], owner: list[httpx.Client]
) -> None:
    address = f"{ADMIN}/studies/short/capsules"
    with host(services, "lost") as lost:
        before = stored_ratings(services)
        visit = Visit(lost, study)
        acknowledged = [visit.rate(trial) for trial in visit.state["trials"][:3]]
        at_lost = lost.browser()
        at_lost.cookies.update(owner[0].cookies)
        begun = at_lost.post(address, json={})
        assert begun.status_code == 202, begun.text
        lost.kill()
    visit.move_to(hosts[1])
    acknowledged += [visit.rate(trial) for trial in visit.state["trials"][3:6]]
    assert stored_ratings(services) - before == Counter(acknowledged)
    soon(lambda: locks_held(services), lambda held: held == 0)

    def left() -> Any:
        return next(one for one in owner[1].get(address).json() if one["id"] == begun.json()["id"])

    ended = soon(left, lambda one: one["status"] in ("failed", "done"))
    assert (ended["status"] == "done") or "stopped before it was finished" in ended["message"]
    assert owner[1].post(address, json={}).status_code == 202
    visit.client.close()


def stored_ratings(services: Services) -> Counter[str]:
    with services.database.read() as session:
        return Counter(session.scalars(text("SELECT rating_id FROM trial_ratings")))


def locks_held(services: Services) -> int:
    query = (
        "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND granted "
        "AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
    )
    with services.database.read() as session:
        return int(session.scalar(text(query)) or 0)


def test_the_limits_of_signing_in_hold_across_hosts(services: Services, hosts: tuple[Host, Host]) -> None:
    one, other = (host.browser() for host in hosts)

    def wrong(browser: httpx.Client, name: str) -> str:
        answer = browser.post(f"{ADMIN}/session", json={"name": name, "password": "not hers at all"})
        return str(answer.json()["error"]["code"])

    said = [wrong(one, "grace") for _ in range(5)]
    assert said == ["wrong_credentials"] * 5
    assert wrong(other, "grace") == "too_many_failures"
    began = time.monotonic()
    said += [wrong(browser, f"nobody {number}") for number in range(9) for browser in (one, other)]
    refilled = (time.monotonic() - began) * LOGINS_PER_MINUTE / 60
    # Each host alone would have let as many pass.
    assert "too_many_requests" in said
    assert said.count("wrong_credentials") <= LOGINS_PER_MINUTE + refilled + 1
    with services.database.read() as session:
        stored = session.execute(text("SELECT * FROM shared_counts")).all()
    assert stored
    assert "127.0.0" not in str(stored)
