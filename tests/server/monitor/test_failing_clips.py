"""A clip that people cannot see is named: which, for how many of how many, and why."""

import uuid
from collections.abc import Collection
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from experiments.load import locate
from server.context import Services
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase, add_study, rated


def take_part(person: Participant, cannot_show: Collection[str], trials: int = 99) -> list[str]:
    """Answer every trial (or the first ones) but those whose clip this browser cannot show."""
    person.agree()
    met = []
    for trial in person.state()["trials"][:trials]:
        if trial["clip_sha256"] is None:
            continue
        met.append(trial["clip_sha256"])
        if trial["clip_sha256"] in cannot_show:
            for play in (1, 2):
                unplayed(person, trial, play)
        else:
            assert person.rate(trial).status_code == 201
    return met


def unplayed(person: Participant, trial: Any, play: int = 1) -> None:
    event: dict[str, Any] = {"id": str(uuid.uuid4()), "type": "clip_unavailable", "at": None}
    event |= {"data": {"clip_sha256": trial["clip_sha256"], "reason": "Decoding error"}}
    assert person.request("POST", "/events", {"events": [event]}).status_code < 300
    none = {"method": "none", "clip_sha256": None, "drawn": None}
    body = {"trial_index": trial["trial_index"], "play": play, "answer": rated(None), "playback": none}
    stored = person.request("PUT", f"/ratings/{uuid.uuid4()}", body)
    assert stored.status_code == 201, stored.text


def clip_of(admin: Admin, number: int) -> dict[str, Any]:
    return dict(admin.get("/studies/short/clips").json()[number])


def test_a_clip_that_fails_for_everybody_raises_an_alarm(
    viewer: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    broken = clip_of(viewer, 0)
    met = [take_part(Participant(client, study.link_token), {broken["clip_sha256"]}) for _ in range(3)]
    assert all(broken["clip_sha256"] in clips for clips in met)
    [found] = viewer.get("/studies/short/failing-clips").json()
    assert (found["file"], found["failed_for"], found["people"]) == (broken["file"], 3, 3)
    assert found["alarm"]
    assert set(found["rules"]) == {"clip_not_played"}
    assert found["reason"] == "Decoding error"


def test_who_did_not_come_to_the_clip_is_not_counted(
    viewer: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    broken = clip_of(viewer, 0)["clip_sha256"]
    people = [Participant(client, study.link_token) for _ in range(3)]
    assert broken in take_part(people[0], {broken})
    assert broken in take_part(people[1], ())
    people[2].agree()
    [found] = viewer.get("/studies/short/failing-clips").json()
    assert (found["failed_for"], found["people"], found["alarm"]) == (1, 2, False)
    take_part(Participant(client, study.link_token), {broken})
    [found] = viewer.get("/studies/short/failing-clips").json()
    assert (found["failed_for"], found["people"], found["alarm"]) == (2, 3, True)


def test_a_clip_that_was_seen_in_a_second_play_has_not_failed(
    viewer: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    person = Participant(client, study.link_token).agree()
    trial = person.state()["trials"][0]
    unplayed(person, trial)
    assert person.rate(trial, play=2).status_code == 201
    assert viewer.get("/studies/short/failing-clips").json() == []


def test_other_origins_raise_no_alarm(viewer: Admin, client: TestClient, study: StudyInDatabase) -> None:
    broken = clip_of(viewer, 0)["clip_sha256"]
    take_part(Participant(client, study.link("preview")), {broken})
    assert viewer.get("/studies/short/failing-clips").json() == []
    study.change(status="pilot")
    take_part(Participant(client, study.link_token), {broken})
    [found] = viewer.get("/studies/short/failing-clips").json()
    assert (found["failed_for"], found["people"]) == (1, 1)
    assert viewer.get("/studies/short/failing-clips?origin=participant").json() == []


def test_every_clip_of_a_trial_that_showed_nothing_is_named(
    viewer: Admin, client: TestClient, services: Services, tmp_path: Path
) -> None:
    declared = locate("pairs-demo").read_text(encoding="utf-8")
    study = add_study(services, tmp_path / "clips", declared, name="short")
    person = Participant(client, study.link_token).agree()
    trial = next(one for one in person.state()["trials"] if len(one["clips"] or ()) == 2)
    first, second = trial["clips"]
    none = {"method": "none", "clip_sha256": None, "drawn": None}
    body = {"trial_index": trial["trial_index"], "play": 1, "playback": none, "rt": None}
    body["answer"] = {"kind": "paired_comparison", "winner": None}
    stored = person.request("PUT", f"/ratings/{uuid.uuid4()}", body)
    assert stored.status_code == 201, stored.text
    found = viewer.get("/studies/short/failing-clips").json()
    assert {one["clip_sha256"] for one in found} == {first["clip_sha256"], second["clip_sha256"]}
