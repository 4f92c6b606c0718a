"""Groups by quota, by link and by the answer of a form: who comes into which, and who is refused."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.models import NO_SLOT, RunEvent, StudyRun, TrialClip
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, add_study

BETWEEN = SHORT.replace('label = "Speed"', 'label = "Speed"\nbetween = true')
QUESTION = """
[[forms.fields]]
type = "choice"
name = "hand"
label = { en = "Which hand?" }
required = true
options = [
    { value = "left", label = { en = "Left" } },
    { value = "right", label = { en = "Right" } },
    { value = "both", label = { en = "Both" } },
]

[[screening]]
rule = "form_answer"
form = "about"
field = "hand"
refused = ["both"]

[groups]
by = "form:hand"
quotas = { slow = 1, fast = 2 }
answers = { left = "slow", right = "fast" }

[texts.en]
"""
BY_FORM = BETWEEN.replace("[texts.en]\n", QUESTION, 1)


TOLD = ("group_name", "slot", "status", "trials_total")


def declared(groups: str) -> str:
    return BETWEEN.replace("[blocks]", f"[groups]\n{groups}\n\n[blocks]")


def groups_of(services: Services) -> list[tuple[str, str]]:
    """Group and status of every run, in the order they began."""
    with services.database.read() as session:
        runs = session.query(StudyRun).order_by(StudyRun.id)
        return [(run.group_name, run.status) for run in runs]


def seen(person: Participant) -> set[str]:
    """Hashes of the clips of a person's trials."""
    return {trial["clip_sha256"] for trial in person.state()["trials"] if trial["clip_sha256"]}


def answers(hand: str) -> dict[str, Any]:
    return {"answers": {"age": 30, "hand": hand}}


def test_a_group_whose_quota_is_full_takes_no_more_turns(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", declared("quotas = { slow = 1, fast = 3 }"))
    people = [Participant(client, study.link_token).agree() for _ in range(4)]
    assert [group for group, _ in groups_of(services)] == ["slow", "fast", "fast", "fast"]
    assert client.get(f"/api/links/{study.link_token}").json()["status"] == "full"
    late = Participant(client, study.link_token)
    assert (late.start().json()["error"]["code"], len(groups_of(services))) == ("study_full", 4)
    # A participant who drops out gives their place back, in their own group.
    people[0].request("POST", "/withdraw")
    assert late.agree().state()["awaits_group"] is False
    assert groups_of(services)[-1] == ("slow", "active")
    assert seen(late) == seen(people[0]).union(seen(late))


def test_within_a_group_with_a_quota_clips_are_dealt_evenly(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    text = declared("quotas = { slow = 4 }\n\n[assignment]\nclips_per_cell = 1")
    study = add_study(services, tmp_path / "clips", text)
    counts = {"slow": Counter[str](), "fast": Counter[str]()}
    for _ in range(8):
        person = Participant(client, study.link_token).agree()
        shown = [one["clip_sha256"] for one in person.state()["trials"] if one["kind"] == "main"]
        counts[groups_of(services)[-1][0]].update(shown)
    assert {name: set(counts[name].values()) for name in counts} == {"slow": {2}, "fast": {2}}
    assert {name: len(counts[name]) for name in counts} == {"slow": 4, "fast": 4}


def test_a_link_carries_the_group_and_the_address_does_not(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", declared('by = "link"\nquotas = { fast = 2 }'))
    slow, fast = study.link(group_name="slow"), study.link(group_name="fast")
    for link in (fast, slow, fast):
        assert Participant(client, link).start(query={}).status_code == 201
    assert [group for group, _ in groups_of(services)] == ["fast", "slow", "fast"]
    refused = Participant(client, fast).start()
    assert (refused.status_code, refused.json()["error"]["code"]) == (409, "study_full")
    forged = Participant(client, slow).start(query={"group": "fast"})
    assert (forged.status_code, forged.json()["error"]["code"]) == (422, "group_refused")
    assert "participants cannot choose their group" in forged.json()["error"]["message"]
    assert Participant(client, slow).start(query={"group": "slow"}).status_code == 201
    # The link that was made without a group leads nowhere.
    assert client.get(f"/api/links/{study.link_token}").json()["status"] == "closed"
    assert Participant(client, study.link_token).start().json()["error"]["code"] == "study_closed"
    assert len(groups_of(services)) == 4
    assert Participant(client, study.link("preview")).start().status_code == 201


def test_a_group_forged_by_the_address_is_refused_where_groups_take_turns(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", BETWEEN)
    for asked in ("fast", "slow", "x" * 400):
        forged = Participant(client, study.link_token).start(query={"group": asked})
        assert forged.json()["error"]["code"] == "group_refused", asked
        assert "\n" not in forged.json()["error"]["message"]
    assert groups_of(services) == []


def test_an_answer_decides_the_group_and_with_it_the_trials(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", BY_FORM)
    person = Participant(client, study.link_token).agree()
    before = person.state()
    assert (before["awaits_group"], before["trials"], before["resumable_until"]) == (True, [], None)
    saved = person.request("PUT", "/forms/about", answers("right")).json()
    assert saved["run"]["awaits_group"] is False
    assert saved["run"]["trials"] == person.state()["trials"]
    assert len(saved["run"]["trials"]) == 8
    assert len(saved["run"]["tickets"]["by_trial"]) == 8
    assert groups_of(services) == [("fast", "active")]
    # The page whose answer was lost sends it again and gets the same trials; another group is refused.
    again = person.request("PUT", "/forms/about", answers("right")).json()
    assert again["run"]["trials"] == saved["run"]["trials"]
    changed = person.request("PUT", "/forms/about", answers("left"))
    assert (changed.status_code, changed.json()["error"]["code"]) == (409, "group_decided")
    person.rate_all()
    assert person.request("POST", "/complete").json()["status"] == "complete"
    assert groups_of(services) == [("fast", "complete")]


def test_erasing_leaves_nothing_of_the_answer_that_decided_the_group(
    client: TestClient, services: Services, experimenter: Admin, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", BY_FORM)
    people = []
    for hand in ("left", "right"):
        people.append(Participant(client, study.link_token).agree())
        people[-1].request("PUT", "/forms/about", answers(hand))
        people[-1].rate_all()
        people[-1].request("POST", "/complete")
        path = f"/studies/short/runs/{people[-1].run_id}/erase"
        assert experimenter.send("POST", path, {"confirm": people[-1].run_id}).status_code == 200
    with services.database.read() as session:
        left, right = (
            {name: getattr(run, name) for name in TOLD}
            for run in session.query(StudyRun).order_by(StudyRun.id)
        )
        assert left == right == {"group_name": "", "slot": NO_SLOT, "status": "complete", "trials_total": 8}
        assert session.query(TrialClip).count() == 0
    # The place is free again.
    late = Participant(client, study.link_token).agree()
    late.request("PUT", "/forms/about", answers("left"))
    assert groups_of(services)[-1] == ("slow", "active")


def test_who_answers_into_a_full_group_is_screened_out_right_after_the_form(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", BY_FORM)
    with_code = study.link(recruiter={"kind": "generic", "code_screened_out": "NO-PLACE"})
    first = Participant(client, study.link_token).agree()
    first.request("PUT", "/forms/about", answers("left"))
    late = Participant(client, with_code).agree()
    saved = late.request("PUT", "/forms/about", answers("left")).json()
    assert (saved["status"], saved["run"]) == ("screened_out", None)
    assert late.request("POST", "/complete").json()["completion_code"] == "NO-PLACE"
    assert late.request("PUT", "/forms/about", answers("right")).json()["error"]["code"] == "run_closed"
    with services.database.read() as session:
        [event] = session.query(RunEvent).filter_by(type="screened_out")
        assert event.data == {"rule": "group_full", "group": "slow"}
        assert session.query(StudyRun).filter_by(status="screened_out").one().slot == NO_SLOT
    # A place that is given up is free for the next one who answers so.
    first.request("POST", "/withdraw")
    other = Participant(client, study.link_token).agree()
    assert other.request("PUT", "/forms/about", answers("left")).json()["run"]["trials"]


def test_an_answer_that_is_screened_out_takes_no_place(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", BY_FORM)
    person = Participant(client, study.link_token).agree()
    assert person.request("PUT", "/forms/about", answers("both")).json()["status"] == "screened_out"
    assert groups_of(services) == [("", "screened_out")]


@pytest.mark.parametrize("complete", [True, False], ids=["complete", "begun"])
def test_the_monitor_counts_groups_against_their_quotas(
    client: TestClient, experimenter: Admin, services: Services, tmp_path: Path, complete: bool
) -> None:
    study = add_study(services, tmp_path / "clips", BY_FORM)
    person = Participant(client, study.link_token).agree()
    person.request("PUT", "/forms/about", answers("right"))
    if complete:
        person.rate_all()
        person.request("POST", "/complete")
    shown = experimenter.get(f"/studies/{study.name}/monitor").json()
    assert shown["groups"] == [
        {"name": "slow", "quota": 1, "complete": 0, "active": 0},
        {"name": "fast", "quota": 2, "complete": int(complete), "active": int(not complete)},
    ]
    rows = experimenter.get(f"/studies/{study.name}/data/runs.csv").text
    assert "group_name" in rows.splitlines()[0]


def test_links_of_a_study_by_link_need_a_group_that_there_is(
    experimenter: Admin, services: Services, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", declared('by = "link"'))
    path = f"/studies/{study.name}/links"
    for body, told in (
        ({"kind": "general"}, "one of slow, fast; got none"),
        ({"kind": "general", "group": "fsat"}, "no group 'fsat'; did you mean 'fast'"),
    ):
        refused = experimenter.send("POST", path, body)
        assert (refused.status_code, told in refused.json()["error"]["message"]) == (422, True), (
            refused.json()
        )
    made = experimenter.send("POST", path, {"kind": "personal", "group": "fast", "count": 2}).json()
    assert [link["group_name"] for link in made] == ["fast", "fast"]
    assert experimenter.get(f"/studies/{study.name}").json()["design"]["groups"] == ["slow", "fast"]
    other = add_study(services, tmp_path / "other", BETWEEN, "other")
    refused = experimenter.send("POST", f"/studies/{other.name}/links", {"kind": "general", "group": "fast"})
    assert "links do not decide groups in this study" in refused.json()["error"]["message"]
