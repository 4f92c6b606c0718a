"""Half of a surrogate pair in a text: refused at the door, and survived where it is stored already."""

import http.client
import io
import json
import urllib.request
import zipfile
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import text

from server.context import Services
from server.core.settings import Settings
from server.core.values import body_problem, is_storable, storable_value
from server.exports import repository, tables
from server.rehearsals.http import JsonClient
from server.rehearsals.person import Person, Rater
from tests.helpers.admins import Admin
from tests.helpers.attacked import Attacked, api_token
from tests.helpers.databases import run_server_command
from tests.helpers.studies import Participant, StudyInDatabase

BAD = [
    rb'{"agent": "\ud800"}',
    rb'{"\uDFFF": 1}',
    rb'{"a": [{"b": "x\udc00y"}]}',
    rb'{"a": "\u0000"}',
    b'{"a": "\xed\xa0\x80"}',
    '{"a": 1}'.encode("utf-16"),
]


@pytest.mark.parametrize("body", BAD)
def test_no_request_brings_one_in(participant: Participant, body: bytes) -> None:
    participant.agree()
    headers = {"authorization": f"Bearer {participant.token}", "content-type": "application/json"}
    for path in ("/api/run/device", "/api/run/events", f"/api/links/{participant.link}/runs"):
        method = "PUT" if path.endswith("device") else "POST"
        answer = participant.client.request(method, path, content=body, headers=headers)
        assert (answer.status_code, answer.json()["error"]["code"]) == (422, "invalid_text"), (path, body)


def test_query_and_headers_bring_none_in(client: TestClient, owner: Admin) -> None:
    for path in ("/audit?before=%ED%A0%80", "/studies/%ED%A0%80", "/studies/%00"):
        assert 400 <= owner.get(path).status_code < 500
    headers = {"user-agent": b"\xed\xa0\x80", "authorization": b"Bearer \xed\xa0\x80"}
    assert client.get("/api/run", headers=headers).status_code in (401, 403, 404)


def test_whole_characters_and_escaped_backslashes_pass(participant: Participant) -> None:
    participant.agree()
    body = rb'{"face": "\ud83d\ude00", "path": "C:\\ud800", "word": "na\u00efve"}'
    headers = {"authorization": f"Bearer {participant.token}", "content-type": "application/json"}
    answer = participant.client.put("/api/run/device", content=body, headers=headers)
    assert answer.status_code == 200, answer.text


json_values = st.recursive(
    st.text() | st.text(st.characters(categories=("Cs", "Lu"))) | st.integers(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(st.characters(categories=("Cs", "Lu"))), inner),
    max_leaves=8,
)


@given(json_values)
def test_what_the_door_lets_in_can_be_stored_and_what_goes_out_can_be_sent(value: Any) -> None:
    def texts(part: Any) -> list[str]:
        if isinstance(part, dict):
            return [*part, *(text for inner in part.values() for text in texts(inner))]
        return [text for inner in part for text in texts(inner)] if isinstance(part, list) else [str(part)]

    body = json.dumps(value)
    assert (body_problem(body.encode()) is None) == all(map(is_storable, texts(json.loads(body))))
    json.dumps(storable_value(value), ensure_ascii=False).encode("utf-8")


@pytest.fixture
def stored(services: Services, participant: Participant) -> Participant:
    """A run whose device and events hold half a pair, stored behind the server's back."""
    participant.agree()
    event = {"id": "6f0e2a52-5f0d-4f0e-9d6f-0d4a3a5f9a11", "type": "note", "data": {"x": "y"}}
    assert participant.request("POST", "/events", {"events": [event]}).status_code == 200
    with services.database.write() as session:
        session.execute(text(r"""UPDATE study_runs SET device = '{"agent": "half \ud800 pair"}'"""))
        session.execute(text(r"""UPDATE run_events SET data = '{"\udc00": "\ud800"}'"""))
    return participant


def test_every_download_is_whole_and_shows_it(stored: Participant, owner: Admin) -> None:
    path = "/studies/short/data"
    raw = owner.get(f"{path}/raw.ndjson").text.splitlines()
    assert json.loads(raw[0])["device"] == {"agent": "half � pair"}
    assert json.loads(raw[-1]) == {"complete": True, "runs": 1}
    table = owner.get(f"{path}/runs.csv")
    assert "half � pair" in table.text
    assert table.headers["palpebra-rows"] == "1"
    with zipfile.ZipFile(io.BytesIO(owner.get(f"{path}/psych-ds.zip").content)) as archive:
        assert archive.testzip() is None
    timeline = owner.get(f"/studies/short/runs/{stored.run_id}")
    assert timeline.status_code == 200
    assert timeline.json()["device"] == {"agent": "half � pair"}


def test_backup_copy_and_command_line_export_survive_it(
    stored: Participant, settings: Settings, tmp_path: Path
) -> None:
    for form in ("csv", "runs", "raw", "psych-ds"):
        called = run_server_command(
            settings, "export", "short", "--format", form, "--out", str(tmp_path / form)
        )
        assert called.returncode == 0, called.stderr
    called = run_server_command(settings, "backup", str(tmp_path / "backup.tar"))
    assert called.returncode == 0, called.stderr
    target = f"sqlite:///{tmp_path / 'copy.sqlite'}"
    called = run_server_command(settings, "database", "copy", settings.database_url, target)
    assert called.returncode == 0, called.stderr
    into = settings.model_copy(update={"database_url": f"sqlite:///{tmp_path / 'again.sqlite'}"})
    called = run_server_command(into, "restore", "--despite-erasures", str(tmp_path / "backup.tar"))
    assert called.returncode == 0, called.stderr


def test_an_export_that_breaks_off_exits_with_an_error_and_leaves_no_file(
    stored: Participant, settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "raw_lines", lambda *_: iter(["{}\n"]))
    monkeypatch.setattr(repository, "run_count", lambda *_: 2)
    called = run_server_command(settings, "export", "short", "--format", "raw", "--out", str(tmp_path / "x"))
    assert called.returncode != 0
    assert "2" in called.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)  # PostgreSQL takes no damaged JSON
@pytest.mark.parametrize("form", ["raw.ndjson", "runs.csv", "psych-ds.zip"])
def test_a_download_that_breaks_off_is_seen_by_the_client(
    attacked: Attacked, services: Services, study: StudyInDatabase, form: str
) -> None:
    """Damage in the store that no export can read: the connection ends before the answer does."""
    client = JsonClient(attacked.url)
    Person(client, Rater(1, 1, {})).begin(study.link_token)
    client.close()
    token = api_token(services, "export")
    with services.database.write() as session:
        session.execute(text("UPDATE study_runs SET device = '{'"))
    request = urllib.request.Request(f"{attacked.url}/api/admin/studies/short/data/{form}")
    request.add_header("authorization", f"Bearer {token}")
    with pytest.raises(http.client.IncompleteRead), urllib.request.urlopen(request, timeout=20) as answer:
        answer.read()
