"""Adaptive series through the API: chosen from stored answers, marked where ahead, ended, exported."""

import json
import uuid
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.models import SeriesAnswer, SeriesOffer, Study, StudyRun, View
from server.participation import quest, series
from server.participation.versions import Versions
from tests.helpers.admins import Admin
from tests.helpers.simulated import take_part
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback
from tests.helpers.thresholds import FACTORS, TWO_INTERVAL, YES_NO, text_with, thresholds


@pytest.fixture
def study(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", text_with(SHORT))


@pytest.fixture
def observer(client: TestClient, study: StudyInDatabase) -> Participant:
    return Participant(client, study.link_token).agree()


def mains(state: Any) -> list[Any]:
    return [trial for trial in state["trials"] if trial["kind"] == "main"]


def of_series(state: Any, number: int) -> list[Any]:
    return [trial for trial in mains(state) if trial["series"]["number"] == number]


def answer(one: Participant, trial: Any, chosen: str | None, rating_id: str = "", **changes: Any) -> Any:
    place = trial["series"] or {"known": 0}
    body = {
        "trial_index": trial["trial_index"],
        "play": 1,
        "answer": {"kind": "threshold", "chosen": chosen, "known": place["known"]},
        "rt": 500.0,
        "playback": good_playback(trial),
        **changes,
    }
    return one.request("PUT", f"/ratings/{rating_id or uuid.uuid4()}", body)


def rows_of(services: Services) -> list[Any]:
    with services.database.read() as session:
        return [row for row in thresholds(session) if row["kind"] == "main"]


def test_the_first_stimuli_are_chosen_before_any_answer(
    observer: Participant, study: StudyInDatabase
) -> None:
    state = observer.state()
    first = of_series(state, 0)[0]
    assert first["series"] == {"number": 0, "position": 1, "known": 0}
    with study.services.database.read() as session:
        offers = session.query(SeriesOffer).filter_by(trial_index=first["trial_index"]).all()
        clip = study.services.versions.get(session, 1).clips[offers[0].version_clip_id]
    assert clip.sha256 == first["clip_sha256"]


def test_an_answer_chooses_the_next_trials_of_its_series(observer: Participant, services: Services) -> None:
    state = observer.state()
    first, other = of_series(state, 0)[0], of_series(state, 1)[0]
    saved = answer(observer, first, "yes")
    assert saved.status_code == 201, saved.text
    following = saved.json()["next"]
    mine = [trial for trial in following["trials"] if trial["series"]["number"] == 0]
    assert [trial["series"]["known"] for trial in mine] == [1, 1, 1]
    assert [trial["series"]["position"] for trial in mine] == [2, 3, 4]
    again = {trial["trial_index"]: trial for trial in observer.state()["trials"]}
    assert all(again[trial["trial_index"]] == trial for trial in mine)
    assert again[other["trial_index"]] == other
    (row,) = rows_of(services)
    assert (row["response"], row["correct"], row["ahead"], row["known"]) == ("yes", 1, 0, 0)
    assert row["value"] == float(row["cell"].split("/")[0])
    assert row["threshold"] is not None
    assert row["threshold_sd"] > 0


def test_yes_leads_to_lower_stimuli_than_no(client: TestClient, study: StudyInDatabase) -> None:
    values = {}
    for chosen in ("yes", "no"):
        one = Participant(client, study.link_token).agree()
        for _ in range(5):
            trial = next(t for t in of_series(one.state(), 0) if not t["answered"])
            answer(one, trial, chosen)
        rows = [row for row in rows_of(study.services) if row["run"] == one.run_id]
        values[chosen] = rows[-1]["threshold"]
    assert values["yes"] < values["no"] - 50


def test_the_same_answers_give_the_same_stimuli_to_everybody_and_in_another_worker(
    client: TestClient, study: StudyInDatabase
) -> None:
    shown = []
    for _ in range(2):
        one, mine = Participant(client, study.link_token).agree(), []
        for chosen in ("yes", "no", "yes"):
            trial = next(t for t in of_series(one.state(), 0) if not t["answered"])
            answer(one, trial, chosen)
            mine.append(chosen)
        rows = [row for row in rows_of(study.services) if row["run"] == one.run_id]
        shown.append([(row["value"], row["threshold"]) for row in rows])
        quest._states.clear()
        again = series.follow_series(study.services.database, Versions(), one.token)
        assert again is not None
        by_trial = {trial["trial_index"]: trial for trial in one.state()["trials"]}
        with study.services.database.read() as session:
            clips = study.services.versions.get(session, 1).clips
            for offer in again.offers:
                assert clips[offer.clip].sha256 == by_trial[offer.trial_index]["clip_sha256"]
    assert shown[0] == shown[1]


def test_trials_whose_answer_is_refused_do_not_hold_up_their_series(observer: Participant) -> None:
    """Else stimuli would be chosen for them, and the trials after them would not adapt."""
    first, second, third = of_series(observer.state(), 0)[:3]
    for trial in (first, second):
        body = {"trial_index": trial["trial_index"], "play": 1, "playback": "lost"}
        ident = str(uuid.uuid4())
        told = {"id": ident, "path": f"/api/run/ratings/{ident}", "status": 422, "code": "invalid"}
        assert observer.request("POST", "/refused", told | {"body": body}).status_code == 202
    following = answer(observer, third, "yes").json()["next"]["trials"]
    assert [one["series"]["position"] for one in following if one["series"]["number"] == 0] == [4, 5, 6]


def test_an_answer_sent_twice_moves_the_series_once(observer: Participant, services: Services) -> None:
    first, name = of_series(observer.state(), 0)[0], str(uuid.uuid4())
    one = answer(observer, first, "yes", name)
    two = answer(observer, first, "yes", name)
    assert (one.status_code, two.status_code) == (201, 200)
    assert one.json() == two.json()
    assert answer(observer, first, "no", name).status_code == 409
    assert len(rows_of(services)) == 1


def test_trials_answered_ahead_are_taken_with_what_was_shown_and_marked(
    observer: Participant, services: Services
) -> None:
    ahead = of_series(observer.state(), 0)[:3]
    shown = [trial["clip_sha256"] for trial in ahead]
    for trial in ahead:  # as the page got them before the first answer was known
        receipt = answer(observer, trial, "yes").json()["receipt"]
        assert (receipt["verdict"], receipt["rule"]) == ("good", "")
    rows = rows_of(services)
    assert [row["clip_sha256"] for row in rows] == shown
    assert [(row["known"], row["ahead"]) for row in rows] == [(0, 0), (0, 1), (0, 2)]
    assert all(row["counts"] for row in rows)
    following = [t for t in of_series(observer.state(), 0) if not t["answered"]]
    assert following[0]["series"]["known"] == 3


def test_the_points_of_a_version_are_made_once(
    observer: Participant, monkeypatch: pytest.MonkeyPatch
) -> None:
    observer.state()
    made: list[Any] = []
    monkeypatch.setattr(series, "points_of", lambda *given: made.append(given))
    for trial in of_series(observer.state(), 0)[:3]:
        assert answer(observer, trial, "yes").status_code == 201
    assert made == []


@pytest.mark.parametrize("number", [0, 1])
def test_a_view_lasts_as_long_as_the_clip_that_was_chosen_when_it_began(
    client: TestClient, study: StudyInDatabase, services: Services, number: int
) -> None:
    """Another clip may be chosen while one is shown; naming one that never was makes no view shorter."""
    one = Participant(client, study.link_token)
    one.start(evidence=True, view_tickets=True)
    one.request("PUT", "/consent", {"agreed": True})
    first, ahead = of_series(one.state(), 0)[:2]
    answer(one, first, "yes")
    shown = next(trial for trial in of_series(one.state(), 0) if trial["trial_index"] == ahead["trial_index"])
    assert shown["clip_sha256"] != ahead["clip_sha256"]
    with services.database.read() as session:
        loaded = services.versions.get(session, 1)
        offered = {offer.version_clip_id for offer in session.query(SeriesOffer)}
        never = next(clip.sha256 for ident, clip in loaded.clips.items() if ident not in offered)
    lengths = {ahead["clip_sha256"]: 10.0, shown["clip_sha256"]: 20.0, never: 1.0}
    loaded.__dict__["lengths"] = {**loaded.lengths, **lengths}
    view = {
        "id": str(uuid.uuid4()),
        "trial_index": ahead["trial_index"],
        "number": 1,
        "started_at_client": "2026-11-21T10:00:00+00:00",
        "outcome": "shown",
        "clips": [{"role": "shown", "clip_sha256": (ahead["clip_sha256"], never)[number], "drawn": []}],
    }
    assert one.request("POST", "/views", {"views": [view]}).status_code == 200
    with services.database.read() as session:
        assert session.query(View).one().clip_ms == (10.0, 20.0)[number]


def test_a_clip_that_was_not_offered_fails(observer: Participant, services: Services) -> None:
    first = of_series(observer.state(), 0)[0]
    swapped = good_playback(first) | {"clip_sha256": "0" * 64}
    receipt = answer(observer, first, "yes", playback=swapped).json()["receipt"]
    assert (receipt["verdict"], receipt["rule"], receipt["again"]) == ("failed", "wrong_clip", True)
    (row,) = rows_of(services)
    assert (row["counts"], row["threshold"]) == (0, None)
    # The next trial's choice does not rest on it.
    assert of_series(observer.state(), 0)[1]["series"]["known"] == 0
    again = answer(observer, first, "yes", play=2)
    assert again.json()["receipt"]["verdict"] == "good"
    assert of_series(observer.state(), 0)[1]["series"]["known"] == 1


@pytest.mark.parametrize(
    ("given", "code"),
    [
        ({"kind": "threshold", "chosen": "first"}, "no_such_answer"),
        ({"kind": "paired_comparison", "winner": "left"}, "answer_of_other_kind"),
        ({"kind": "threshold", "chosen": "maybe"}, "invalid"),
        ({"kind": "threshold", "chosen": "yes", "known": -1}, "invalid"),
    ],
)
def test_what_is_not_an_answer_is_refused_in_one_line(
    observer: Participant, services: Services, given: dict[str, Any], code: str
) -> None:
    refused = answer(observer, of_series(observer.state(), 0)[0], None, answer=given)
    assert refused.status_code == 422
    assert refused.json()["error"]["code"] == code, refused.text
    assert "\n" not in refused.json()["error"]["message"]
    assert rows_of(services) == []


def test_a_series_ends_early_and_its_trials_need_no_answer(
    client: TestClient, services: Services, tmp_path: Path
) -> None:
    rule = YES_NO.replace("stop = { trials = 8 }", "stop = { trials = 12, at_least = 4, sd = 200.0 }")
    study = add_study(services, tmp_path / "clips", text_with(SHORT, rule))
    one = Participant(client, study.link_token).agree()
    before = one.state()
    late = of_series(before, 0)[5]
    for place in range(4):
        saved = answer(one, of_series(one.state(), 0)[place], "yes").json()
    closed = {trial["trial_index"] for trial in of_series(before, 0)[4:]}
    assert set(saved["next"]["closed"]) == closed
    assert saved["receipt"]["remaining"] == len(before["trials"]) - 4 - len(closed)
    assert all(trial["answered"] for trial in of_series(one.state(), 0))
    assert not any(trial["answered"] for trial in of_series(one.state(), 1))
    # A page that was away may have shown one of them: it is kept, and counted once.
    kept = answer(one, late, "no").json()
    assert kept["receipt"]["remaining"] == saved["receipt"]["remaining"]
    one.answer_forms()
    while due := [trial for trial in one.state()["trials"] if not trial["answered"]]:
        asked = 1 if due[0]["kind"] != "attention" else int(due[0]["prompt"].split("**")[1])
        assert answer(one, due[0], ["yes", "no"][asked - 1]).status_code == 201
    done = one.request("POST", "/complete")
    assert done.status_code == 200, done.text
    with services.database.read() as session:
        run = session.query(StudyRun).one()
        assert run.trials_answered <= run.trials_total


def test_a_trial_that_failed_while_its_series_ended_is_still_asked_for(
    client: TestClient, services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rule = YES_NO.replace("stop = { trials = 8 }", "stop = { trials = 12, at_least = 4, sd = 200.0 }")
    study = add_study(services, tmp_path / "clips", text_with(SHORT, rule))
    one = Participant(client, study.link_token).agree()
    late, failed = of_series(one.state(), 0)[5], list[Any]()
    reckoned = series.outlook_after

    def meanwhile(*stored: Any) -> series.Outlook:
        outlook = reckoned(*stored)
        if outlook.closing and not failed:
            failed.append(None)
            wrong = good_playback(late) | {"clip_sha256": "0" * 64}
            failed[0] = answer(one, late, "yes", playback=wrong).json()["receipt"]
        return outlook

    monkeypatch.setattr(series, "outlook_after", meanwhile)
    for place in range(4):
        saved = answer(one, of_series(one.state(), 0)[place], "yes").json()
    assert failed[0]["again"]
    assert late["trial_index"] not in saved["next"]["closed"]
    (asked,) = [trial for trial in one.state()["trials"] if trial["trial_index"] == late["trial_index"]]
    assert not asked["answered"]


@pytest.mark.usefixtures("one_seed")
@pytest.mark.parametrize("task", [YES_NO, TWO_INTERVAL], ids=["yes_no", "two_interval"])
def test_simulated_observers_answer_to_the_end_and_the_csv_has_their_series(
    client: TestClient, services: Services, tmp_path: Path, task: str
) -> None:
    # Another order of the trials gives other answers, of which some few are wrong by chance.
    study = add_study(services, tmp_path / "clips", text_with(SHORT, task))
    take_part(client, study, "threshold=250,spread=20,sd=0")
    rows = [row for row in rows_of(services) if row["counts"]]
    assert {row["series"] for row in rows} == {"s1", "s2"}
    assert all(row["ahead"] == 0 for row in rows if row["play"] == 1)
    two = task == TWO_INTERVAL
    plain = [row for row in rows if row["value"] >= 400]
    wrong = sum(not row["correct"] if two else row["response"] == "no" for row in plain)
    assert wrong <= len(plain) / 3
    if two:
        assert {row["interval"] for row in rows} == {"first", "second"}
        assert all((row["response"] == row["interval"]) == bool(row["correct"]) for row in rows)
    with services.database.read() as session:
        found = session.query(Study).filter_by(name=study.name).one()
        lines = b"".join(FORMATS["csv"](session, found, Extract("all"))).decode().splitlines()
        codebook = b"".join(FORMATS["codebook"](session, found, Extract("all"))).decode()
    header = lines[0].split(",")
    assert {"series", "duration", "value", "response", "correct", "ahead", "threshold"} <= set(header)
    assert "| ahead | integer |" in codebook


SECOND = 'second = { factor = "character", values = { photorealistic = 0, cartoon = 1 } }'
GRID = YES_NO.replace('{ factor = "duration" }', f'{{ factor = "duration", {SECOND} }}').replace(
    "= 8", "= 24"
)
GRID_OF_TWO = TWO_INTERVAL.replace('{ factor = "duration" }', f'{{ factor = "duration", {SECOND} }}').replace(
    'standard = "100"', 'standard = "100"\nstandard_second = "photorealistic"'
)


@pytest.mark.usefixtures("one_seed")
@pytest.mark.parametrize("task", [GRID, GRID_OF_TWO], ids=["yes_no", "two_interval"])
def test_a_series_over_two_factors_moves_over_the_grid_of_both(
    client: TestClient, services: Services, tmp_path: Path, task: str
) -> None:
    study = add_study(services, tmp_path / "clips", text_with(SHORT, task))
    take_part(client, study, "threshold=300,spread=20,tilt=150")
    rows = [row for row in rows_of(services) if row["counts"]]
    assert {row["series"] for row in rows} == {"s1"}
    shown = {tuple(json.loads(row["levels"]).values()) for row in rows}
    assert len(shown) > 2
    assert {character for _, character in shown} == {"photorealistic", "cartoon"}
    assert all(row["value"] == float(json.loads(row["levels"])["duration"]) for row in rows)
    last = max(rows, key=lambda row: row["position"])
    assert abs(last["threshold"] - 300) < 3 * last["threshold_sd"] + 20
    assert last["entropy"] < rows[0]["entropy"]


def test_each_group_runs_its_own_series(client: TestClient, services: Services, tmp_path: Path) -> None:
    factors = FACTORS.replace('label = "Character"', 'label = "Character"\nbetween = true')
    study = add_study(services, tmp_path / "clips", text_with(SHORT, YES_NO, factors))
    take_part(client, study, "threshold=250", seeds=range(2))
    rows = [row for row in rows_of(services) if row["counts"]]
    series_of_run = {
        run: {row["series"] for row in rows if row["run"] == run} for run in {r["run"] for r in rows}
    }
    assert sorted(map(sorted, series_of_run.values())) == [["s1"], ["s2"]]
    assert all(row["threshold"] is not None for row in rows)


def test_erasure_leaves_nothing_of_what_was_answered(
    observer: Participant, services: Services, experimenter: Admin
) -> None:
    assert answer(observer, of_series(observer.state(), 0)[0], "yes").status_code == 201
    path = f"/studies/short/runs/{observer.run_id}/erase"
    assert experimenter.send("POST", path, {"confirm": observer.run_id}).status_code == 200
    with services.database.read() as session:
        assert session.query(SeriesAnswer).count() == session.query(SeriesOffer).count() == 0
