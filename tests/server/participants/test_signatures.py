"""Signed URLs of recruiters: they take up a visit, and nothing else that names somebody does."""

import hashlib
import hmac
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from server.context import Services
from server.core.values import hash_token
from server.models import Link, Study, StudyRun
from server.participation.identity_repository import known_as
from server.participation.recruiter import Recruiter, is_signed, signature_of, signing_secret
from server.participation.refusals import SignatureWrong
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

RECRUITER = {"kind": "generic", "signature_parameter": "sig"}
PERSON = "P-17 é&="


@pytest.fixture
def link(study: StudyInDatabase, services: Services) -> str:
    with services.database.write() as session:
        session.query(Study).one().recruiter = RECRUITER
    return study.link_token


def secret_of(services: Services, study: str = "short", name: str = "") -> bytes:
    with services.database.read() as session:
        found = session.query(Study).filter_by(name=study).one()
        return signing_secret(services.settings.key, found.pseudonym_key, name)


@pytest.fixture
def signed(services: Services, link: str) -> dict[str, str]:
    """The parameters of a signed URL, made as the recruiter's side makes them."""
    code = hmac.new(secret_of(services), PERSON.encode(), hashlib.sha256).hexdigest()
    return {"participant": PERSON, "sig": code}


def begun(client: TestClient, link: str, query: dict[str, str]) -> Participant:
    person = Participant(client, link)
    assert person.start(query=query).status_code == 201
    assert person.request("PUT", "/consent", {"agreed": True}).status_code == 200
    return person


def code_of(answer: Any) -> tuple[int, str]:
    assert set(answer.json()["error"]) == {"code", "message", "details"}
    return answer.status_code, answer.json()["error"]["code"]


def test_a_signed_address_takes_up_its_visit_on_another_device(
    client: TestClient, link: str, signed: dict[str, str]
) -> None:
    person = begun(client, link, signed)
    other = Participant(client, link)
    assert other.start(query=signed | {"sig": signed["sig"].upper(), "further": "x"}).status_code == 200
    assert other.run_id == person.run_id
    assert other.state()["run_id"] == person.run_id


def test_no_attack_on_the_signature_gives_a_token(
    client: TestClient, link: str, signed: dict[str, str], services: Services, tmp_path: Path
) -> None:
    person = begun(client, link, signed)
    add_study(services, tmp_path / "other", SHORT.replace('"short"', '"other"', 1), name="other")
    right = signed["sig"]
    attacks = {
        "another study's": (PERSON, signature_of(secret_of(services, "other"), PERSON)),
        "another id's": (PERSON, signature_of(secret_of(services), "P-18")),
        "another secret's": (PERSON, signature_of(secret_of(services, name="2"), PERSON)),
        "truncated": (PERSON, right[:32]),
        "longer": (PERSON, f"{right}0"),
        "beyond ASCII": (PERSON, right[:-1] + "é"),
        "of zeros": (PERSON, "0" * 64),
        "checked before": (PERSON, "checked"),
        "of this person, for another": ("P-18", right),
    }
    for name, (identifier, code) in attacks.items():
        attacker = Participant(client, link)
        answer = attacker.start(query={"participant": identifier, "sig": code}, anew=True)
        assert code_of(answer) == (409, "signature_wrong"), name
        assert (attacker.token, person.run_id in answer.text, right in answer.text) == ("", False, False)
    for query in ({"participant": PERSON}, {"participant": PERSON, "sig": ""}):
        assert code_of(Participant(client, link).start(query=query, anew=True)) == (409, "signature_missing")
    assert person.state()["status"] == "active"


def test_the_browsers_own_secret_and_the_code_need_no_signature(
    client: TestClient, link: str, signed: dict[str, str]
) -> None:
    person = begun(client, link, signed)
    assert person.start(query={"participant": PERSON}).status_code == 200
    shown = person.state()["resume_code"]
    other = Participant(client, link)
    assert other.start(query={"participant": PERSON}, resume_code=shown).status_code == 200
    assert other.run_id == person.run_id


def test_who_began_before_addresses_were_signed_may_be_anybody(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    """Somebody who knew the id, and guessed what would be stored of a signature, began under it first."""
    with services.database.write() as session:
        session.query(Study).one().recruiter = {"kind": "sona"}
    hashed = hashlib.sha256(b"checked").hexdigest()
    stranger = begun(client, study.link_token, {"survey_code": "40177", "sig": f"sha256:{hashed}"})
    with services.database.write() as session:
        session.query(Study).one().recruiter = {"kind": "sona", "signature_parameter": "sig"}
    person = Participant(client, study.link_token)
    query = {"survey_code": "40177", "sig": signature_of(secret_of(services), "40177")}
    assert code_of(person.start(query=query)) == (409, "resume_code_needed")
    assert person.start(query=query, anew=True).status_code == 201
    assert person.run_id != stranger.run_id
    again = Participant(client, study.link_token)
    assert again.start(query=query).status_code == 200
    assert again.run_id == person.run_id


def test_what_is_stored_opens_nothing(
    client: TestClient, link: str, signed: dict[str, str], services: Services, owner: Admin
) -> None:
    person = begun(client, link, signed)
    with services.database.read() as session:
        known = known_as(session, session.query(StudyRun).one())
        assert known is not None
        kept = known.parameters["sig"]
    assert kept.startswith("sha256:")
    assert signed["sig"] not in owner.get(f"/studies/short/runs/{person.run_id}/identity").text
    assert code_of(Participant(client, link).start(query=signed | {"sig": kept})) == (409, "signature_wrong")


def test_another_name_of_the_secret_ends_all_addresses_signed_before(
    client: TestClient, link: str, signed: dict[str, str], services: Services
) -> None:
    begun(client, link, signed)
    with services.database.write() as session:
        session.query(Study).one().recruiter = RECRUITER | {"secret_name": "2"}
    assert code_of(Participant(client, link).start(query=signed)) == (409, "signature_wrong")
    anew = signed | {"sig": signature_of(secret_of(services, name="2"), PERSON)}
    assert code_of(Participant(client, link).start(query=anew)) == (409, "resume_code_needed")
    assert Participant(client, link).start(query=anew, anew=True).status_code == 201


def test_an_address_that_names_nobody_needs_no_signature(client: TestClient, link: str) -> None:
    assert Participant(client, link).start().status_code == 201


def test_owners_see_the_secret_with_examples_that_run(
    client: TestClient, link: str, owner: Admin, experimenter: Admin
) -> None:
    path = "/studies/short/links/signing"
    assert experimenter.get(path).status_code == 403
    told = owner.get(path).json()
    ran = subprocess.run([sys.executable, "-c", told["python"]], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == told["signature"]
    query = dict(parse_qsl(told["query"]))
    assert Participant(client, link).start(query=query).status_code == 201
    entries = [entry for entry in owner.get("/audit").json() if entry["action"] == "signing secret read"]
    assert [entry["target"] for entry in entries] == ["short"]
    assert told["secret"] not in str(entries)


def test_the_example_of_a_link_is_by_its_own_recruiter_and_may_be_pasted(
    client: TestClient, link: str, services: Services, owner: Admin
) -> None:
    own = {"kind": "generic", "id_parameter": "person & no=", "signature_parameter": "the sig"}
    with services.database.write() as session:
        one = session.query(Link).filter_by(token_hash=hash_token(link)).one()
        one.recruiter, public_id = own | {"secret_name": "2"}, one.public_id
    told = owner.get(f"/studies/short/links/signing?link={public_id}").json()
    assert (told["declared"], told["parameter"], told["secret_name"]) == (True, "the sig", "2")
    assert " " not in told["query"]
    query = dict(parse_qsl(told["query"], strict_parsing=True))
    assert query == {"person & no=": told["identifier"], "the sig": told["signature"]}
    assert Participant(client, link).start(query=query).status_code == 201
    assert owner.get("/studies/short/links/signing").json()["parameter"] == "sig"
    assert owner.get("/studies/short/links/signing?link=none").status_code == 404


def test_the_command_prints_the_same_and_openssl_agrees(
    services: Services, link: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from server.cli import app

    monkeypatch.setenv("PALPEBRA_SECRET_KEY", services.settings.secret_key)
    monkeypatch.setenv("PALPEBRA_DATA_FOLDER", str(services.settings.data_folder))
    monkeypatch.setenv("DATABASE_URL", services.settings.database_url)
    ran = CliRunner().invoke(app, ["link", "secret", "short"])
    assert ran.exit_code == 0, ran.output
    said = capsys.readouterr().out + ran.output
    assert secret_of(services).hex() in said
    shell = next(line for line in said.splitlines() if line.startswith("printf"))
    signed = subprocess.run(["sh", "-c", shell], capture_output=True, text=True, check=True).stdout
    assert signed.split()[-1] == signature_of(secret_of(services), "P-0001")


@given(st.text(max_size=80).filter(bool), st.text(max_size=80))
def test_only_the_signature_of_the_id_signs(identifier: str, code: str) -> None:
    key, recruiter = b"k" * 32, Recruiter(signature_parameter="sig")
    right = signature_of(signing_secret(key, "00", ""), identifier)
    assert is_signed(key, "00", recruiter, {"participant": identifier, "sig": right})
    if code and code.lower() != right:
        with pytest.raises(SignatureWrong):
            is_signed(key, "00", recruiter, {"participant": identifier, "sig": code})
