"""What goes wrong with a study is shown on its page and sent to its owners, once."""

import json
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.core.settings import Settings
from server.core.values import now
from server.models import Account, Study, StudyRun, Workspace, WorkspaceMember
from server.operations import watch
from server.operations.doctor import findings_for_studies
from server.operations.watch import WatchedServer, look_at_studies
from tests.helpers.admins import Admin
from tests.helpers.mail import ADDRESS, Letterbox, smtp_server
from tests.helpers.studies import Participant, StudyInDatabase
from tests.server.monitor.test_failing_clips import take_part


class Hook:
    """A webhook of this machine: what came, and how it answers."""

    def __init__(self) -> None:
        self.taken: list[dict[str, str]] = []
        self.status = 200
        self.hangs = threading.Event()
        self.is_hanging = False


@contextmanager
def webhook() -> Iterator[tuple[Hook, str]]:
    hook = Hook()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            if hook.is_hanging:
                hook.hangs.wait(20)
                return
            if hook.status == 200:
                hook.taken.append(json.loads(body))
            self.send_response(hook.status)
            self.end_headers()

        def log_message(self, format: str, *args: Any) -> None:
            """Nothing on the screen of tests."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield hook, f"http://127.0.0.1:{server.server_port}/hook"
    finally:
        hook.hangs.set()
        server.shutdown()
        server.server_close()


@pytest.fixture
def hook(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[Hook]:
    with webhook() as (made, address):
        monkeypatch.setattr(settings, "webhook_url", address)
        yield made


@pytest.fixture
def box(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[Letterbox]:
    with smtp_server() as (letters, port):
        for name, value in {
            "smtp_host": "127.0.0.1",
            "smtp_port": port,
            "smtp_security": "none",
            "mail_from": "Palpebra <palpebra@lab.example>",
        }.items():
            monkeypatch.setattr(settings, name, value)
        yield letters


def own(services: Services) -> None:
    """Let the only account own the study, with a confirmed address."""
    with services.database.write() as session:
        account = session.query(Account).one()
        account.email = ADDRESS
        study = session.query(Study).one()
        if study.workspace_id is None:
            workspace = Workspace(name="watched", title="Watched")
            session.add(workspace)
            session.flush()
            study.workspace_id = workspace.id
            session.add(WorkspaceMember(workspace_id=workspace.id, account_id=account.id, role="owner"))


def look(services: Services) -> None:
    examine = partial(findings_for_studies, services)
    look_at_studies(WatchedServer(services.settings, services.database, services.locks, examine))


def events(admin: Admin) -> dict[str, str]:
    return {one["kind"]: one["text"] for one in admin.get("/studies/short/warnings").json()}


def test_a_quiet_study_has_no_warnings(owner: Admin, study: StudyInDatabase) -> None:
    assert owner.get("/studies/short/warnings").json() == []
    assert owner.get("/studies/nobodys/warnings").status_code == 404


def test_a_clip_that_fails_is_sent_once_with_a_link(
    owner: Admin, client: TestClient, services: Services, study: StudyInDatabase, box: Letterbox, hook: Hook
) -> None:
    own(services)
    clip = owner.get("/studies/short/clips").json()[0]
    look(services)
    assert (box.letters, hook.taken) == ([], [])
    for _ in range(3):
        take_part(Participant(client, study.link_token), {clip["clip_sha256"]})
    assert f"{clip['file']} could not be shown to 3 of 3 people" in events(owner)["clip"]
    for _ in range(2):
        look(services)
    [letter] = [one for one in box.letters if clip["file"] in one.get_content()]
    link = f"{services.settings.public_url}/admin/studies/short/clips"
    assert link in letter.get_content()
    [taken] = [one for one in hook.taken if one["kind"] == "clip"]
    assert (taken["study"], taken["link"]) == ("short", link)
    entries = [one for one in owner.get("/audit").json() if one["action"] == "warning sent"]
    assert [one["details"]["by"] for one in entries if "clip" in one["details"]["event"]] == [
        ["mail", "webhook"]
    ]


def test_drop_outs_and_a_full_quota_are_named(
    owner: Admin, client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    for number in range(4):
        person = Participant(client, study.link_token).agree()
        if number == 3:
            person.rate_all()
            person.answer_forms()
            assert person.request("POST", "/complete").status_code == 200
    assert events(owner) == {}
    with services.database.write() as session:
        long_ago = now() - timedelta(hours=5)
        session.query(StudyRun).filter_by(status="active").update({"last_seen_at": long_ago})
    assert "3 of 4 people who reached the page" in events(owner)["drop_outs"]
    study.change(quota=1)
    assert "1 of 1 runs are complete: the study is full" in events(owner)["quota"]
    study.change(quota=2)
    assert "quota" not in events(owner)
    study.change(status="closed")
    assert events(owner) == {}


def test_flagged_plays_above_a_share_are_named(
    owner: Admin, client: TestClient, study: StudyInDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    clips = [clip["clip_sha256"] for clip in owner.get("/studies/short/clips").json()]
    take_part(Participant(client, study.link_token), ())
    monkeypatch.setattr(watch, "PLAYS_AT_LEAST", 10)
    assert "plays" not in events(owner)
    take_part(Participant(client, study.link_token), clips)
    assert "clips were shown with flaws (" in events(owner)["plays"]


def test_a_full_disk_reaches_owners_without_the_names_of_folders(
    owner: Admin, services: Services, study: StudyInDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.operations.doctor.LEAST_FREE_BYTES", 1 << 60)
    text = events(owner)["server"]
    assert "data folder" in text
    assert str(services.settings.data_folder) not in text


@pytest.mark.parametrize("fault", ["hangs", "refuses", "is gone"])
def test_a_webhook_that_fails_is_one_line_and_the_event_is_sent_later(
    owner: Admin,
    services: Services,
    study: StudyInDatabase,
    hook: Hook,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
) -> None:
    monkeypatch.setattr("server.operations.doctor.LEAST_FREE_BYTES", 1 << 60)
    monkeypatch.setattr(watch, "WEBHOOK_S", 0.5)
    address = services.settings.webhook_url
    hook.is_hanging, hook.status = fault == "hangs", 500 if fault == "refuses" else 200
    if fault == "is gone":
        monkeypatch.setattr(services.settings, "webhook_url", "http://127.0.0.1:9/hook")
    with caplog.at_level(logging.ERROR):
        look(services)
    [line] = [one.getMessage() for one in caplog.records if one.name == watch.LOG.name]
    expected = {"hangs": "did not answer within 0.5 s", "refuses": "got 500", "is gone": "cannot be reached"}
    assert expected[fault] in line
    assert "/hook" not in line
    assert not [one for one in owner.get("/audit").json() if one["action"] == "warning sent"]
    hook.is_hanging, hook.status = False, 200
    monkeypatch.setattr(services.settings, "webhook_url", address)
    for _ in range(2):
        look(services)
    assert [one["kind"] for one in hook.taken] == ["server"]


def test_mail_that_is_refused_keeps_no_webhook_from_a_warning(
    owner: Admin,
    services: Services,
    study: StudyInDatabase,
    hook: Hook,
    box: Letterbox,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own(services)
    monkeypatch.setattr("server.operations.doctor.LEAST_FREE_BYTES", 1 << 60)
    port = services.settings.smtp_port
    monkeypatch.setattr(services.settings, "smtp_port", 9)
    with caplog.at_level(logging.ERROR):
        look(services)
    said = [one.getMessage() for one in caplog.records]
    assert ["an email was not sent" in text for text in said if "results ahead" not in text] == [True]
    assert [one["kind"] for one in hook.taken] == ["server"]
    [entry] = [one for one in owner.get("/audit").json() if one["action"] == "warning sent"]
    assert entry["details"]["by"] == ["webhook"]
    monkeypatch.setattr(services.settings, "smtp_port", port)
    for _ in range(2):
        look(services)
    assert (len(box.letters), len(hook.taken)) == (1, 1)
