"""Where participants are sent on to: web addresses whose host the study's people wrote, and nothing else."""

from typing import Any

import pytest
from sqlalchemy import update

from server.context import Services
from server.models import Study
from server.operations.doctor import return_addresses
from server.participation.recruiter import stored_recruiter
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase

KEYS = ("redirect_url", "redirect_declined", "redirect_screened_out")
HOSTILE = [
    "javascript:alert(1)",
    "JavaScript:alert(1)",
    "data:text/html,<script>",
    "//evil.example/x",
    "https:///evil.example",
    "https://",
    "https:\\\\evil.example",
    "https://good.example\\@evil.example/",
    "https://good.example@evil.example/",
    "https://{participant}/done",
    "https://good.{site}.example/",
    "https://good.example/\r\nlocation: x",
    "https://good.example/\tx",
    " https://good.example/",
    "java\nscript:alert(1)",
]


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("address", HOSTILE)
@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_no_link_leads_participants_elsewhere(
    experimenter: Admin, study: StudyInDatabase, key: str, address: str
) -> None:
    body = {"kind": "general", "recruiter": {"kind": "generic", key: address}}
    answer = experimenter.send("POST", "/studies/short/links", body)
    assert answer.status_code == 422, answer.text
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]
    recruiter = {"kind": "generic", key: address}
    settings = {"revision": revision, "paused": False, "quota": None, "recruiter": recruiter}
    assert experimenter.send("PUT", "/studies/short/settings", settings).status_code == 422


@pytest.mark.parametrize(
    "address",
    [
        "https://good.example",
        "http://good.example:80/a?p={code}&q={who}#end",
        "https://[::1]/a b",
        "",
    ],
)
def test_ordinary_addresses_are_taken(address: str) -> None:
    declared: dict[str, Any] = dict.fromkeys(KEYS, address)
    assert stored_recruiter(declared).redirect_url == address


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_what_an_earlier_release_took_ends_no_visit(
    services: Services, study: StudyInDatabase, participant: Participant
) -> None:
    with services.database.write() as session:
        stored = {"kind": "sona", "redirect_url": "https://{participant}/", "code_complete": "DONE"}
        session.execute(update(Study).values(recruiter=stored))
    read = stored_recruiter(stored)
    assert (read.redirect_url, read.code_complete, read.kind) == ("", "DONE", "sona")
    participant.agree()


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_study_with_an_address_of_before_is_paused_and_reported_by_the_doctor(
    services: Services, experimenter: Admin, study: StudyInDatabase
) -> None:
    """Its page sends all settings, the address too; another that is refused is not saved with it."""
    [fine] = return_addresses(services)
    assert fine.verdict == "ok"
    with services.database.write() as session:
        stored = {"kind": "sona", "redirect_url": "https://{participant}/", "code_complete": "DONE"}
        session.execute(update(Study).values(recruiter=stored))
    detail = experimenter.get("/studies/short").json()
    revision = detail["summary"]["revision"]
    order = {"revision": revision, "paused": True, "quota": 7, "recruiter": detail["recruiter"]}
    paused = experimenter.send("PUT", "/studies/short/settings", order)
    assert (paused.status_code, paused.json()["summary"]["paused"]) == (200, True)
    assert paused.json()["recruiter"]["redirect_url"] == "https://{participant}/"
    [told] = return_addresses(services)
    assert (told.verdict, "short" in told.state) == ("warning", True)
    order["revision"] = paused.json()["summary"]["revision"]
    order["recruiter"] = detail["recruiter"] | {"redirect_declined": "https://{other}/"}
    refused = experimenter.send("PUT", "/studies/short/settings", order)
    assert (refused.status_code, "redirect_declined" in refused.json()["error"]["message"]) == (422, True)
    order["recruiter"] = detail["recruiter"] | {"redirect_url": "https://other.{participant}/"}
    assert experimenter.send("PUT", "/studies/short/settings", order).status_code == 422
    order["recruiter"] = detail["recruiter"] | {"redirect_url": "https://sona.example/{participant}"}
    assert experimenter.send("PUT", "/studies/short/settings", order).status_code == 200
    [fine] = return_addresses(services)
    assert fine.verdict == "ok"


def test_a_null_address_of_before_is_none() -> None:
    assert stored_recruiter({"kind": "sona", "redirect_url": None}).redirect_url == ""
