"""Studies copied, archived and compared."""

import tomllib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from server.accounts.identity import OPERATOR
from server.context import Services
from server.core.values import now
from server.studies.lookup import find_study
from server.studies.series import word_difference
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase


def edited(experimenter: Admin, study: dict[str, Any], **changes: Any) -> dict[str, Any]:
    data = tomllib.loads(study["toml"]) | changes
    toml = experimenter.send("POST", "/definitions/edit", {"toml": study["toml"], "data": data}).json()[
        "toml"
    ]
    body = {"revision": study["summary"]["revision"], "toml": toml, "note": "edited"}
    saved = experimenter.send("POST", f"/studies/{study['summary']['name']}/versions", body)
    assert saved.status_code == 201, saved.text
    return dict(saved.json())


def test_a_copy_has_declaration_and_clips_and_no_people(
    experimenter: Admin, study: StudyInDatabase, client: Any
) -> None:
    Participant(client, study.link_token).agree().rate_all()
    made = experimenter.send("POST", "/studies/short/copies", {"name": "again"})
    assert made.status_code == 201, made.text
    copy, source = made.json(), experimenter.get("/studies/short").json()
    assert (copy["toml"], copy["definition_sha256"]) == (source["toml"], source["definition_sha256"])
    assert (copy["summary"]["status"], copy["summary"]["active"], copy["recruiter"]) == ("draft", 0, None)
    assert copy["versions"][0]["note"] == "copied from short, version 1"
    clips = [experimenter.get(f"/studies/{name}/clips").json() for name in ("short", "again")]
    assert clips[0] == clips[1]
    assert experimenter.get("/studies/again/links").json()["total"] == 0
    assert experimenter.send("POST", "/studies/short/copies", {"name": "again"}).status_code == 409
    missing = experimenter.send("POST", "/studies/short/copies", {"name": "third", "version": 9})
    assert (missing.status_code, "no version 9" in missing.text) == (404, True)


def test_a_copy_can_be_of_an_older_version(experimenter: Admin, study: StudyInDatabase) -> None:
    first = experimenter.get("/studies/short").json()
    edited(experimenter, first, title="Another title")
    old = experimenter.send("POST", "/studies/short/copies", {"name": "old", "version": 1}).json()
    assert old["summary"]["title"] == first["summary"]["title"]


def test_an_archived_study_can_be_read_and_not_changed(experimenter: Admin, study: StudyInDatabase) -> None:
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]
    refused = experimenter.send("PUT", "/studies/short/archive", {"revision": revision, "archived": True})
    assert (refused.status_code, "Close it first" in refused.text) == (409, True)
    closed = experimenter.send(
        "PUT", "/studies/short/status", {"revision": revision, "status": "closed"}
    ).json()
    revision = closed["summary"]["revision"]
    kept = experimenter.send("PUT", "/studies/short/archive", {"revision": revision, "archived": True}).json()
    assert kept["summary"]["archived_at"] is not None
    revision = kept["summary"]["revision"]
    opened = experimenter.send("PUT", "/studies/short/status", {"revision": revision, "status": "live"})
    assert (opened.status_code, "Remove it from the archive" in opened.text) == (409, True)
    assert experimenter.get("/studies/short/data/ratings.csv").status_code == 200
    out = experimenter.send("PUT", "/studies/short/archive", {"revision": revision, "archived": False}).json()
    assert out["summary"]["archived_at"] is None
    revision = out["summary"]["revision"]
    assert (
        experimenter.send(
            "PUT", "/studies/short/status", {"revision": revision, "status": "live"}
        ).status_code
        == 200
    )


def test_an_archived_study_gets_no_links_versions_or_seal_and_is_not_deleted(
    experimenter: Admin, services: Services, study: StudyInDatabase
) -> None:
    link = experimenter.send("POST", "/studies/short/links", {"kind": "general"}).json()[0]["id"]
    with services.database.write() as session:
        find_study(session, "short", OPERATOR, "view").status = "draft"
        find_study(session, "short", OPERATOR, "view").archived_at = now()
    for method, path, body in (
        ("POST", "/studies/short/links", {"kind": "general"}),
        ("POST", "/studies/short/seal", {}),
        ("DELETE", "/studies/short", None),
    ):
        refused = experimenter.send(method, path, body)
        assert (refused.status_code, "archived" in refused.text) == (409, True), (method, path)
    # What takes something back from the study stays possible.
    assert experimenter.send("DELETE", f"/studies/short/links/{link}").status_code == 204
    assert experimenter.send("POST", "/studies/short/copies", {"name": "again"}).status_code == 201


def test_numbers_that_no_column_holds_are_refused(
    experimenter: Admin, owner: Admin, study: StudyInDatabase
) -> None:
    for number in (0, 2**31, 2**70):
        copied = experimenter.send("POST", "/studies/short/copies", {"name": "again", "version": number})
        asked = [
            experimenter.get("/studies/short/results", params={"series": number}),
            experimenter.get("/studies/short/methods", params={"series": number}),
            experimenter.get("/studies/short/methods/methods.txt", params={"series": number}),
            experimenter.get(f"/studies/short/versions/{number}"),
            experimenter.send("POST", "/studies/short/reports", {"series": number}),
            experimenter.send("DELETE", f"/sessions/{number}"),
            experimenter.send("DELETE", f"/tokens/{number}"),
            owner.send("DELETE", f"/invitations/{number}"),
            owner.send("PATCH", f"/accounts/{number}", {"disabled": True}),
        ]
        assert {one.status_code for one in (copied, *asked)} == {422}, (number, [one.text for one in asked])
    largest = experimenter.send("POST", "/studies/short/copies", {"name": "again", "version": 2**31 - 1})
    assert largest.status_code == 404


def test_two_versions_compared_word_by_word(experimenter: Admin, study: StudyInDatabase) -> None:
    first = experimenter.get("/studies/short").json()
    trial = tomllib.loads(first["toml"])["trial"]
    trial["scale"]["question"]["en"] = "How lively?"
    edited(experimenter, first, title="A short and lively study", trial=trial)
    found = experimenter.get("/studies/short/comparison", params={"old": 1, "new": 2}).json()
    keys = {key["path"]: key for key in found["keys"]}
    assert set(keys) == {"title", "trial.scale.question.en"}
    assert keys["title"]["pieces"] == [
        {"kind": "same", "text": "A short "},
        {"kind": "new", "text": "and lively "},
        {"kind": "same", "text": "study"},
    ]
    assert keys["title"]["effect"] == "wording"
    assert (found["pooled"], found["clips"], found["clips_same"]) == (False, [], 8)
    assert found["keys"][0]["effect"] == "measured"
    unknown = experimenter.get("/studies/short/comparison", params={"old": 1, "new": 7})
    assert (unknown.status_code, "no version 7" in unknown.text) == (404, True)


def test_clips_that_differ_are_named(experimenter: Admin, study: StudyInDatabase) -> None:
    first = experimenter.get("/studies/short").json()
    data = tomllib.loads(first["toml"])
    fewer = [data["factors"][0], data["factors"][1] | {"levels": data["factors"][1]["levels"][:1]}]
    edited(experimenter, first, factors=fewer)
    found = experimenter.get("/studies/short/comparison", params={"old": 1, "new": 2}).json()
    assert {(clip["kind"], clip["cell"]) for clip in found["clips"]} == {
        ("gone", "a/fast"),
        ("gone", "b/fast"),
    }
    assert (found["clips_differing"], found["clips_same"]) == (4, 4)


def test_two_studies_compared(experimenter: Admin, study: StudyInDatabase) -> None:
    copy = experimenter.send("POST", "/studies/short/copies", {"name": "again"}).json()
    edited(experimenter, copy, title="Again")
    query = {"old": 1, "new": 2, "other": "short"}
    found = experimenter.get("/studies/again/comparison", params=query).json()
    assert (found["old"]["study"], found["new"]["study"]) == ("short", "again")
    assert (found["pooled"], [key["path"] for key in found["keys"]]) == (True, ["title"])


@given(st.text(max_size=60), st.text(max_size=60))
def test_a_difference_holds_both_texts_whole(old: str, new: str) -> None:
    pieces = word_difference(old, new)
    assert "".join(text for kind, text in pieces if kind != "new") == old
    assert "".join(text for kind, text in pieces if kind != "gone") == new


def test_long_texts_are_compared_by_line() -> None:
    old = "".join(f"line {number} of many words\n" for number in range(2000))
    pieces = word_difference(old, old.replace("line 7 ", "line seven "))
    assert ("gone", "line 7 of many words\n") in pieces
