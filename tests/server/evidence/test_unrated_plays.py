"""A play without a rating needs evidence too: else a script ends a study by plays that showed nothing."""

from typing import Any

import pytest

from server.context import Services
from server.models import AnswerEvidence, RunEvent
from server.participation.intake import TRIED_MS, UNFETCHED
from tests.helpers.evidence import Watcher

NOT_FETCHED = {"digest": None}
TRIED_S = TRIED_MS / 1000


def unrated(watcher: Watcher, trial: Any, play: int, **changes: Any) -> Any:
    """Send a play at which no clip was shown."""
    evidence = watcher.evidence(trial, play, **changes)
    return watcher.answer(trial, evidence, play=play, response=None, rt=None, playback={"method": "none"})


def go_through(watcher: Watcher, pause_s: float, **changes: Any) -> list[str]:
    """Leave every trial unrated, attention checks apart; returns the refusals."""
    refusals = []
    for trial in watcher.state()["trials"]:
        if not trial["clip_sha256"]:
            assert watcher.rate(trial, 4, evidence=watcher.evidence(trial)).status_code == 201
            continue
        for play, _ in enumerate(watcher.tickets["by_trial"][trial["trial_index"]], 1):
            watcher.wait(pause_s)
            answer = unrated(watcher, trial, play, **changes)
            if answer.status_code != 201:
                refusals.append(answer.json()["error"]["code"])
            elif not answer.json()["receipt"]["again"]:
                break
    return refusals


def complete(watcher: Watcher) -> Any:
    """The answer to the request for the completion code."""
    watcher.answer_forms()
    return watcher.request("POST", "/complete").json()


def test_plays_without_ratings_sent_at_once_give_no_completion_code(watcher: Watcher) -> None:
    refusals = go_through(watcher, 0.0)
    assert set(refusals) == {"clips_outlast_tickets"}
    assert complete(watcher)["error"]["code"] == "ratings_missing"


def test_who_fetches_no_clip_gets_no_completion_code_however_long_it_takes(watcher: Watcher) -> None:
    refusals = go_through(watcher, 60.0, **NOT_FETCHED)
    assert set(refusals) == {"clip_digest_missing"}
    assert complete(watcher)["error"]["code"] == "ratings_missing"


def test_a_false_digest_is_refused(watcher: Watcher) -> None:
    assert set(go_through(watcher, 60.0, digest="0" * 64)) == {"clip_digest_differs"}


def test_a_person_whose_browser_decodes_no_clip_gets_the_code(watcher: Watcher, services: Services) -> None:
    assert go_through(watcher, TRIED_S + 0.1) == []
    assert complete(watcher)["completion_code"]
    with services.database.read() as session:
        tried = session.query(AnswerEvidence).filter(AnswerEvidence.clip_ms > 0).all()
    assert {one.clip_ms for one in tried} == {TRIED_MS}
    assert all(one.digest_right for one in tried)


def test_a_person_who_cannot_fetch_a_few_clips_goes_on(watcher: Watcher) -> None:
    trials = [trial for trial in watcher.state()["trials"] if trial["clip_sha256"]]
    for number, trial in enumerate(trials):
        watcher.wait(TRIED_S)
        changes = NOT_FETCHED if number < UNFETCHED else {}
        assert unrated(watcher, trial, 1, **changes).status_code == 201


def test_clips_that_the_server_has_lost_hold_nobody_up(watcher: Watcher, services: Services) -> None:
    watcher.wait(1.0)
    for path in services.settings.clip_folder.rglob("*.mp4"):
        path.unlink()
    assert go_through(watcher, TRIED_S, **NOT_FETCHED) == []
    assert complete(watcher)["completion_code"]


def test_a_missing_digest_of_a_play_without_rating_says_nothing_of_the_person(
    watcher: Watcher, services: Services
) -> None:
    """Reloads in mid-play, each before its clip was there: no more is stored, the run is not blamed."""
    assert go_through(watcher, 60.0, **NOT_FETCHED)
    with services.database.read() as session:
        kinds = {event.type for event in session.query(RunEvent)}
    assert "answer_expired" in kinds
    assert "answer_refused" not in kinds


@pytest.mark.parametrize("seen_s", [0.1, 1.0])
def test_a_play_that_a_reload_broke_off_is_taken_at_once(watcher: Watcher, seen_s: float) -> None:
    trial = next(one for one in watcher.state()["trials"] if one["clip_sha256"])
    view = {
        "id": "6f1c6b7a-0d4d-4c0b-9a70-3e4a6f0a7c55",
        "trial_index": trial["trial_index"],
        "number": 1,
        "started_at_client": watcher.moment.isoformat(),
        "evidence": {name: watcher.evidence(trial)[name] for name in ("batch", "ticket")},
    }
    watcher.wait(10.0)
    assert watcher.request("POST", "/views", {"views": [view]}).status_code == 200
    watcher.wait(seen_s)
    watcher.state()
    watcher.wait(0.1)
    assert unrated(watcher, trial, 1, **NOT_FETCHED).status_code == 201
