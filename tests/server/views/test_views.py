"""Views are stored when they begin and completed when they end, each once."""

import json
import uuid
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import text

from server.context import Services
from server.models import View, ViewClip
from server.participation.views import pack_log, unpack_log
from tests.helpers.studies import Participant, StudyInDatabase

BEGUN = "2026-11-21T10:00:00+00:00"
ENDED = "2026-11-21T10:00:01+00:00"
entries = st.tuples(st.integers(0, 1_000_000), st.integers(-(10**12), 10**12).map(lambda steps: steps / 100))


def a_view(trial: Any, number: int = 1, **changes: Any) -> dict[str, Any]:
    view = {"id": str(uuid.uuid4()), "trial_index": trial["trial_index"], "number": number}
    return view | {"started_at_client": BEGUN, "screen": {"full_screen": True}} | changes


def ended(view: dict[str, Any], trial: Any) -> dict[str, Any]:
    clip = {"role": "shown", "clip_sha256": trial["clip_sha256"], "drawn": [[0, 0], [1, 33.37], [2, 66.7]]}
    return view | {"ended_at_client": ENDED, "clips": [clip]}


def send(participant: Participant, *views: dict[str, Any]) -> Any:
    return participant.request("POST", "/views", {"views": list(views)})


@given(st.lists(entries, max_size=200))
def test_a_frame_log_comes_back(log: list[tuple[int, float]]) -> None:
    assert unpack_log(pack_log(log)) == log


def test_a_packed_log_is_a_fraction_of_its_json() -> None:
    log = [(index, round(10.03 + index * 1000 / 60, 2)) for index in range(120)]
    assert len(pack_log(log)) < 0.45 * len(json.dumps(log))


def test_a_view_begun_is_stored_though_it_never_ends(participant: Participant, services: Services) -> None:
    trial = participant.agree().state()["trials"][0]
    assert send(participant, a_view(trial)).json()["begun"] == 1
    with services.database.read() as session:
        row = session.query(View).one()
        assert (row.number, row.completed, row.ended_at_client, row.screen) == (
            1,
            False,
            None,
            {"full_screen": True},
        )


def test_a_view_is_begun_and_completed_once(participant: Participant, services: Services) -> None:
    trial = participant.agree().state()["trials"][0]
    view = a_view(trial)
    whole = ended(view, trial)
    answers = [send(participant, *batch).json() for batch in ([view], [view], [view, whole], [whole])]
    assert [(one["begun"], one["completed"]) for one in answers] == [(1, 0), (0, 0), (0, 1), (0, 0)]
    with services.database.read() as session:
        assert session.query(View).one().completed
        assert unpack_log(session.query(ViewClip).one().frame_log) == [(0, 0), (1, 33.37), (2, 66.7)]


def test_views_of_other_trials_and_taken_numbers_are_refused(
    participant: Participant, services: Services
) -> None:
    trial = participant.agree().state()["trials"][0]
    stored = a_view(trial)
    send(participant, stored)
    for refused, code in (
        (a_view({"trial_index": 999}), "trial_not_in_run"),
        (a_view(trial), "view_differs"),
        (stored | {"number": 2}, "view_differs"),
    ):
        answer = send(participant, a_view(trial, 5), refused)
        assert answer.json()["error"]["code"] == code
    with services.database.read() as session:
        assert session.query(View).count() == 1


def test_nothing_is_stored_before_consent(participant: Participant, study: StudyInDatabase) -> None:
    participant.start()
    answer = send(participant, a_view({"trial_index": 0}))
    assert answer.json()["error"]["code"] == "consent_missing"


def shown(view: dict[str, Any], trial: Any, **changes: Any) -> dict[str, Any]:
    showing = {
        "roles": ["shown"],
        "method": "webcodecs",
        "frames": 4,
        "fps": 30,
        "ended_ms": 150,
        "stalls": 0,
    }
    showing |= {"clock_gap_ms": 17.2, "clock_late_ms": 0.5, "focus_lost": 0}
    return ended(view, trial) | {"outcome": "shown", "showings": [showing]} | changes


def main_trial(participant: Participant, index: int = 0) -> Any:
    return [trial for trial in participant.state()["trials"] if trial["kind"] == "main"][index]


def test_a_view_without_its_answer_comes_back_with_the_run(participant: Participant) -> None:
    participant.agree()
    trial = main_trial(participant)
    whole = shown(a_view(trial, play=1), trial)
    send(participant, whole)
    again = main_trial(participant)
    assert again["views_begun"] == 1
    [view] = again["views"]
    assert (view["id"], view["ended"], view["outcome"], view["play"]) == (whole["id"], True, "shown", 1)
    assert view["clips"] == whole["clips"]
    assert view["showings"][0]["clock_gap_ms"] == 17.2
    participant.rate(again)
    answered = main_trial(participant)
    assert (answered["views_begun"], answered["views"]) == (1, [])


def test_a_view_broken_off_fails_its_play_and_both_are_exported(
    participant: Participant, services: Services
) -> None:
    participant.agree()
    trial = main_trial(participant)
    first = a_view(trial, play=1)
    send(participant, first)
    assert [view["ended"] for view in main_trial(participant)["views"]] == [False]
    send(participant, first | {"outcome": "interrupted", "disturbances": {"interrupted": 1}})
    none = {"method": "none", "drawn": None, "disturbances": {"interrupted": 1}}
    receipt = participant.rate(trial, None, playback=none).json()["receipt"]
    assert (receipt["verdict"], receipt["rule"], receipt["again"]) == ("failed", "interrupted", True)
    waiting = main_trial(participant)
    assert (waiting["plays_done"], waiting["plays_wanted"], waiting["views"]) == (1, 2, [])
    send(participant, shown(a_view(trial, 2, play=2), trial, disturbances={"zoomed": 1}))
    participant.rate(trial, play=2, playback={"disturbances": {"zoomed": 1}})
    columns = "play, views, view_outcomes, disturbances, verdict_rule"
    query = text(f"SELECT {columns} FROM ratings WHERE kind = 'main' ORDER BY play")
    with services.database.read() as session:
        rows = [tuple(row) for row in session.execute(query)]
    assert rows == [
        (1, 1, "interrupted", '{"interrupted": 1}', "interrupted"),
        (2, 2, "shown", '{"zoomed": 1}', "zoomed"),
    ]


def test_what_happened_is_in_the_order_of_the_views(participant: Participant, services: Services) -> None:
    participant.agree()
    trial = main_trial(participant)
    begun = [a_view(trial, number, play=1) for number in (1, 2, 3)]
    send(participant, shown(begun[2], trial), begun[0], begun[1] | {"outcome": "interrupted"})
    participant.rate(trial)
    query = text("SELECT views, view_outcomes, disturbances FROM ratings WHERE kind = 'main'")
    with services.database.read() as session:
        assert tuple(session.execute(query).one()) == (3, "begun interrupted shown", None)


def test_an_answer_whose_page_kept_no_views_has_none(participant: Participant, services: Services) -> None:
    participant.agree()
    participant.rate(main_trial(participant))
    query = text("SELECT views, view_outcomes, disturbances FROM ratings WHERE kind = 'main'")
    with services.database.read() as session:
        assert tuple(session.execute(query).one()) == (None, None, None)


def test_bad_views_are_refused_in_one_line_each(participant: Participant) -> None:
    participant.agree()
    trial = main_trial(participant)
    for changed in (
        {"outcome": "lost"},
        {"play": 0},
        {"disturbances": {"Bad Name": 1}},
        {"showings": [{"roles": ["shown"]}]},
        {"more": 1},
    ):
        answer = send(participant, a_view(trial) | changed)
        assert answer.status_code == 422
        assert "\n" not in answer.json()["error"]["message"]
