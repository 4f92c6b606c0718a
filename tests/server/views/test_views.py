"""Views are stored when they begin and completed when they end, each once."""

import json
import uuid
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from server.context import Services
from server.models import View, ViewClip
from server.views.frame_log import packed, unpacked
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
    assert unpacked(packed(log)) == log


def test_a_packed_log_is_a_fraction_of_its_json() -> None:
    log = [(index, round(10.03 + index * 1000 / 60, 2)) for index in range(120)]
    assert len(packed(log)) < 0.45 * len(json.dumps(log))


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
        assert unpacked(session.query(ViewClip).one().frame_log) == [(0, 0), (1, 33.37), (2, 66.7)]


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
