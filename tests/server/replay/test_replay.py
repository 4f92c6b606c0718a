"""What the replay is given equals what the page sent: frame by frame, view by view, play by play."""

import uuid
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.results.replay import rebuilt_views
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant

BEGUN, ENDED = "2026-11-21T10:00:00+00:00", "2026-11-21T10:00:01+00:00"
STALLED = [[0, 31.02], [1, 64.4], [3, 464.4], [3, 500.0]]


def view_of(trial: Any, number: int = 1, play: int = 1, **changes: Any) -> dict[str, Any]:
    shown = {"role": "shown", "clip_sha256": trial["clip_sha256"], "drawn": STALLED}
    measured = {"roles": ["shown"], "method": "webcodecs", "frames": 4, "fps": 30, "ended_ms": 533.5}
    measured |= {"stalls": 0, "clock_gap_ms": 400.0, "clock_late_ms": 1.0, "focus_lost": 1}
    view = {"id": str(uuid.uuid4()), "trial_index": trial["trial_index"], "number": number, "play": play}
    view |= {"started_at_client": BEGUN, "ended_at_client": ENDED, "outcome": "shown", "clips": [shown]}
    view |= {"screen": {"width_px": 1280, "height_px": 720}, "showings": [measured]}
    return view | {"disturbances": {"focus_lost": 1}} | changes


def replay_of(viewer: Admin, person: Participant, path: str = "") -> Any:
    answer = viewer.get(f"/studies/short/runs/{person.run_id}/replay{path}")
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.fixture
def person(participant: Participant) -> Participant:
    return participant.agree()


def test_every_view_comes_back_as_it_was_sent(viewer: Admin, person: Participant) -> None:
    trial = person.state()["trials"][0]
    first = view_of(trial)
    again = view_of(trial, 2, 2, clips=[], outcome="interrupted", showings=None, ended_at_client=None)
    assert person.request("POST", "/views", {"views": [first, again]}).status_code == 200
    assert person.rate(trial, 5, comment="jerky", answered_at_client=ENDED).status_code == 201
    one, other = replay_of(viewer, person, f"/trials/{trial['trial_index']}")["plays"]
    [view] = one["views"]
    assert view["clips"] == first["clips"]
    assert view["screen"] == first["screen"]
    assert (view["showings"][0]["ended_ms"], view["disturbances"]) == (533.5, {"focus_lost": 1})
    assert (one["answer"]["response"], one["comment"], one["rt"]) == (5, "jerky", 700.5)
    assert one["verdict"] in ("good", "uncertain", "flagged", "failed")
    assert (other["play"], other["answer"], other["views"][0]["outcome"]) == (2, None, "interrupted")


def test_the_list_says_what_can_be_played(viewer: Admin, person: Participant) -> None:
    trials = person.state()["trials"]
    person.request("POST", "/views", {"views": [view_of(trials[0])]})
    person.rate(trials[1], 4)
    replay = replay_of(viewer, person)
    assert [one["trial_index"] for one in replay["trials"]] == [one["trial_index"] for one in trials]
    first, second, third = replay["trials"][:3]
    assert (first["views"], first["plays"], first["verdict"]) == (1, 1, None)
    assert (second["views"], second["plays"], second["verdict"] is None) == (0, 1, False)
    assert (third["views"], third["plays"], third["verdict"]) == (0, 0, None)
    assert replay["trial"]["kind"] == "clip_rating"
    assert replay["display"]["background"] == "#808080"
    [clip] = first["clips"]
    assert clip["role"] == "shown"
    assert clip["cell"]


def test_events_of_the_trial_and_no_others_are_reported(viewer: Admin, person: Participant) -> None:
    trial = person.state()["trials"][0]
    person.request("POST", "/views", {"views": [view_of(trial)]})
    person.rate(trial, 4, answered_at_client="2026-11-21T10:00:03+00:00")
    sent = {"09:59:00": "offline", "10:00:01": "focus_lost", "10:00:02": "heartbeat", "10:09:00": "online"}
    events = [
        {"id": str(uuid.uuid4()), "type": kind, "at": f"2026-11-21T{at}+00:00", "data": {}}
        for at, kind in sent.items()
    ]
    assert person.request("POST", "/events", {"events": events}).status_code == 200
    told = replay_of(viewer, person, f"/trials/{trial['trial_index']}")["events"]
    assert [event["type"] for event in told] == ["focus_lost"]


def test_a_run_without_a_ledger_is_rebuilt_from_its_answers(viewer: Admin, person: Participant) -> None:
    trial = person.state()["trials"][0]
    person.rate(trial, 4)
    replayed = replay_of(viewer, person, f"/trials/{trial['trial_index']}")
    [view] = replayed["plays"][0]["views"]
    assert (view["from_answer"], view["number"]) == (True, 1)
    assert view["clips"][0]["drawn"][1] == [1, 43.3]
    assert [clip["clip_sha256"] for clip in replayed["clips"]] == [trial["clip_sha256"]]


def test_looks_are_written_down_and_refused_without_leave(
    viewer: Admin, owner: Admin, person: Participant
) -> None:
    trial = person.state()["trials"][0]["trial_index"]
    replay_of(viewer, person)
    replay_of(viewer, person, f"/trials/{trial}")
    looks = [entry for entry in owner.get("/audit").json() if entry["action"] == "personal data read"]
    assert {entry["details"]["part"] for entry in looks} == {"replay", f"trial {trial}"}
    missing = viewer.get(f"/studies/short/runs/{person.run_id}/replay/trials/999")
    assert (missing.status_code, "trial 999" in missing.text) == (404, True)


def test_an_erased_run_has_nothing_to_play(experimenter: Admin, person: Participant) -> None:
    trial = person.state()["trials"][0]
    person.request("POST", "/views", {"views": [view_of(trial)]})
    path = f"/studies/short/runs/{person.run_id}/erase"
    assert experimenter.send("POST", path, {"confirm": person.run_id}).status_code == 200
    replay = replay_of(experimenter, person)
    assert replay["erased"]
    assert not any(one["views"] for one in replay["trials"])


@given(
    st.lists(st.lists(st.integers(0, 500), min_size=1, max_size=20, unique=True), min_size=1, max_size=6),
    st.sampled_from([["shown"], ["left", "right"], ["reference", "first", "second"]]),
)
def test_a_rebuilt_log_loses_no_frame(starts: list[list[int]], roles: list[str]) -> None:
    """Every drawn frame is in exactly one view, for each clip that one clock drew."""
    showings = [
        [(index, 10.0 * row) for row, index in enumerate([0, *sorted(set(one) - {0})])] for one in starts
    ]
    drawn = [entry for showing in showings for entry in showing]
    views = rebuilt_views(drawn, dict.fromkeys(roles, "ab" * 32))
    spoken_for = [clip.drawn for view in views for clip in view.clips if clip.role != "right"]
    assert [entry for log in spoken_for for entry in log] == drawn
    assert [view.number for view in views] == list(range(1, len(views) + 1))
