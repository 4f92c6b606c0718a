"""A record that can never be stored holds nobody up, and no number of a browser makes a record one."""

import copy
import uuid
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from server.context import Services, open_services
from server.core.settings import Settings
from server.models import Rating, RunEvent, StudyRun
from server.participation.answer_schemas import RatingIn, ViewsIn
from server.participation.judgement import judge_run
from server.participation.warnings import failed_checks
from tests.helpers.admins import Admin
from tests.helpers.evidence import Watcher
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback

HASH = "a" * 64
TRIAL = {"trial_index": 3, "clip_sha256": HASH, "frames": 4}
MOMENT = "2026-11-28T10:00:00+00:00"
RATING: dict[str, Any] = {
    "trial_index": 3,
    "play": 1,
    "answer": {
        "kind": "clip_rating",
        "answers": {"rating": {"response": 4, "rt": 300.0}},
        "reference_gap_ms": 5.0,
    },
    "rt": 300.0,
    "rt_from_first_frame": 900.0,
    "time_elapsed": 12_000,
    "changes": 1,
    "answered_at_client": MOMENT,
    "playback": {**good_playback(TRIAL), "disturbances": {"focus_lost": 1}},
    "evidence": {
        "batch": "b",
        "ticket": "t",
        "digest": HASH,
        "interaction": {"presses": 2, "trusted": 2, "press_ms": 90.0, "moves": 5},
    },
}
SHOWING = {
    "roles": ["shown"],
    "method": "video",
    "frames": 4,
    "fps": 30.0,
    "ended_ms": 140.0,
    "stalls": 0,
    "clock_gap_ms": None,
    "clock_late_ms": None,
    "focus_lost": 0,
    "visible_share": 1.0,
    "refresh_ms": 16.7,
}
VIEWS: dict[str, Any] = {
    "views": [
        {
            "id": str(uuid.uuid4()),
            "trial_index": 3,
            "number": 1,
            "play": 1,
            "started_at_client": MOMENT,
            "ended_at_client": MOMENT,
            "outcome": "shown",
            "clips": [{"role": "shown", "clip_sha256": HASH, "drawn": [[0, 0.0], [1, 33.4]]}],
            "showings": [SHOWING],
            "disturbances": {"zoomed": 1},
        }
    ]
}
# JSON has no NaN: a page sends null in its place.
NUMBERS = st.one_of(
    st.none(),
    st.integers(),
    st.floats(),
    st.sampled_from([-57, -749.3, 1e308, -1e-9, 2**63, 10**30, 0.5, 1e11]),
)
MOMENTS = st.sampled_from(
    [None, "1969-12-31T23:59:59Z", "+275760-09-13T00:00:00.000Z", "0001-01-01T00:00:00+14:00"]
)
# What the server has given and the page sends back, what the participant has said, and names.
NOT_MEASURED = ("trial_index", "play", "number", "response", "presses", "trusted", "moves")


def places(body: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The path of every measured number and moment in a record."""
    items = body.items() if isinstance(body, dict) else enumerate(body) if isinstance(body, list) else ()
    for key, value in items:
        if key in NOT_MEASURED:
            continue
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))
        elif isinstance(value, int | float) or value is None or value == MOMENT:
            yield (*path, key)


def changed(body: dict[str, Any], path: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    """The record with another value there."""
    other = copy.deepcopy(body)
    here: Any = other
    for step in path[:-1]:
        here = here[step]
    here[path[-1]] = value
    return other


@pytest.mark.parametrize("path", list(places(RATING)), ids=str)
@given(number=NUMBERS, moment=MOMENTS)
def test_no_number_of_a_browser_makes_an_answer_invalid(
    path: tuple[str | int, ...], number: Any, moment: str | None
) -> None:
    value = moment if path[-1] == "answered_at_client" else number
    rating = RatingIn.model_validate(changed(RATING, path, value))
    assert rating.answer.stored()["response"] == 4


@pytest.mark.parametrize("path", list(places(VIEWS)), ids=str)
@given(number=NUMBERS, moment=MOMENTS)
def test_no_number_of_a_browser_makes_a_view_invalid(
    path: tuple[str | int, ...], number: Any, moment: str | None
) -> None:
    value = moment if str(path[-1]).endswith("_at_client") else number
    [view] = ViewsIn.model_validate(changed(VIEWS, path, value)).views
    assert (view.trial_index, view.outcome) == (3, "shown")


@given(st.lists(st.tuples(st.sampled_from(list(places(RATING))), NUMBERS), min_size=2, max_size=9))
def test_nor_do_many_at_once(faults: list[tuple[tuple[str | int, ...], Any]]) -> None:
    body = RATING
    for path, value in faults:
        if path[-1] != "answered_at_client":
            body = changed(body, path, value)
    assert RatingIn.model_validate(body).answer.stored()["response"] == 4


def test_what_is_not_measured_is_still_refused() -> None:
    for path, value in (
        ("trial_index", -1),
        ("play", 0),
        ("playback", None),
        ("answer", {"kind": "clip_rating"}),
    ):
        with pytest.raises(ValidationError):
            RatingIn.model_validate(RATING | {path: value})


def test_an_answer_with_sound_numbers_is_left_as_it_is() -> None:
    rating = RatingIn.model_validate(RATING)
    assert rating.playback.disturbances == {"focus_lost": 1}
    assert (rating.rt, rating.playback.key_to_first_frame_ms) == (300.0, 9.5)


def refused(path: str, body: dict[str, Any], ident: str | None = None, **told: Any) -> dict[str, Any]:
    """What the page sends of a record that got a 4xx."""
    own = ident or str(uuid.uuid4())
    base = {
        "id": own,
        "path": f"{path}{own}" if path.endswith("/") else path,
        "status": 422,
        "code": "invalid",
    }
    return base | {"message": "as something on the way said", "body": body} | told


def report(participant: Participant, body: dict[str, Any], **told: Any) -> Any:
    return participant.request("POST", "/refused", refused("/api/run/ratings/", body, **told))


def unstorable(trial: Any) -> dict[str, Any]:
    answer = {"kind": "clip_rating", "answers": {"rating": {"response": 99}}}
    return {
        "trial_index": trial["trial_index"],
        "play": 1,
        "answer": answer,
        "playback": good_playback(trial),
    }


def main_trials(participant: Participant) -> list[Any]:
    return [trial for trial in participant.state()["trials"] if trial["kind"] == "main"]


def test_a_run_with_refused_answers_gets_its_code_and_the_experimenter_the_reason(
    participant: Participant, viewer: Admin
) -> None:
    first, second = main_trials(participant.agree())[:2]
    assert report(participant, unstorable(first)).status_code == 202
    assert (
        report(participant, {"trial_index": second["trial_index"], "play": 1, "playback": "lost"}).status_code
        == 202
    )
    shown = {trial["trial_index"]: trial for trial in participant.state()["trials"]}
    assert shown[first["trial_index"]]["answered"]
    assert shown[second["trial_index"]]["answered"]
    participant.answer_all()
    done = participant.request("POST", "/complete").json()
    assert (done["status"], bool(done["completion_code"])) == ("complete", True)
    [run] = viewer.get("/studies/short/runs").json()["runs"]
    assert (run["refused"], run["answered"]) == (2, 10)
    timeline = viewer.get(f"/studies/short/runs/{participant.run_id}").json()
    events = [event["data"] for event in timeline["events"] if event["type"] == "record_refused"]
    assert timeline["summary"]["refused"] == 2
    assert [event["trial_index"] for event in events] == [first["trial_index"], second["trial_index"]]
    assert "from 1 to 7" in events[0]["reason"]
    assert events[0]["record"]["answer"]["answers"]["rating"]["response"] == 99
    assert "answer" in events[1]["reason"]


def test_an_answer_refused_on_its_way_is_stored_as_the_answer_that_it_is(
    participant: Participant, services: Services
) -> None:
    trial = main_trials(participant.agree())[0]
    sound = unstorable(trial) | {"answer": {"kind": "clip_rating", "answers": {"rating": {"response": 5}}}}
    ident = str(uuid.uuid4())
    for _ in range(2):
        assert report(participant, sound, ident=ident, status=403, code="http_403").status_code == 202
    with services.database.read() as session:
        assert [(row.rating_id, row.payload) for row in session.query(Rating)] == [(ident, {"response": 5})]
        assert session.query(RunEvent).filter_by(type="record_refused").count() == 0


def test_a_refused_record_is_kept_once_whatever_it_holds(
    participant: Participant, services: Services
) -> None:
    trial = main_trials(participant.agree())[0]
    odd = unstorable(trial) | {
        "comment": "a" * 6000,
        "playback": {"drawn": [[0, 1.5]] * 20_000},
    }
    ident = str(uuid.uuid4())
    for _ in range(2):
        assert report(participant, odd, ident=ident).status_code == 202
    with services.database.read() as session:
        [event] = session.query(RunEvent).filter_by(type="record_refused")
        assert event.data["record"]["comment"] == "a" * 6000
        assert "drawn" not in event.data["record"]["playback"]


@pytest.mark.parametrize("depth", [30, 900])
def test_a_record_of_any_depth_is_kept_as_far_as_it_can_be(participant: Participant, depth: int) -> None:
    participant.agree()
    deep: Any = None
    for _ in range(depth):
        deep = [deep]
    assert participant.request("POST", "/refused", refused("/api/run/views", {"x": deep})).status_code == 202


def test_a_refused_view_holds_nothing_up(participant: Participant, viewer: Admin) -> None:
    participant.agree()
    told = refused("/api/run/views", {"views": [{"id": "x"}]})
    assert participant.request("POST", "/refused", told).status_code == 202
    assert viewer.get("/studies/short/runs").json()["runs"][0]["refused"] == 1


def test_a_page_cannot_name_an_event_so(participant: Participant) -> None:
    participant.agree()
    event = {"id": str(uuid.uuid4()), "type": "record_refused", "data": {"trial_index": 0}}
    assert participant.request("POST", "/events", {"events": [event]}).status_code == 422


def test_a_refused_attention_check_counts_as_failed(participant: Participant, services: Services) -> None:
    """Else a script would pass every check by answers that are refused."""
    trials = participant.agree().state()["trials"]
    check = next(trial for trial in trials if trial["kind"] == "attention")
    assert report(participant, unstorable(check)).status_code == 202
    with services.database.read() as session:
        run = session.query(StudyRun).one()
        experiment = services.versions.get(session, run.version_id).experiment
        assert failed_checks(session.connection(), run.id, experiment) == 1


def test_a_check_that_is_answered_after_a_refusal_counts_by_its_answer(
    participant: Participant, services: Services
) -> None:
    """Once, and not as failed where it was answered as asked."""
    trials = participant.agree().state()["trials"]
    check = next(trial for trial in trials if trial["kind"] == "attention")
    assert report(participant, unstorable(check)).status_code == 202
    assert participant.rate(check, *asked_for(check)).status_code == 201
    with services.database.read() as session:
        run = session.query(StudyRun).one()
        experiment = services.versions.get(session, run.version_id).experiment
        assert failed_checks(session.connection(), run.id, experiment) == 0


def asked_for(check: Any) -> list[int]:
    return [int(word) for word in check["prompt"].replace("*", " ").split() if word.isdigit()][:1]


def test_refused_attention_checks_end_a_run_as_wrong_ones_do(
    client: Any, services: Services, tmp_path: Any
) -> None:
    """Else refused answers would be a way around the screening."""
    toml = SHORT + '\n[[screening]]\nrule = "attention_checks_failed"\n'
    study = add_study(services, tmp_path / "clips", toml)
    person = Participant(client, study.link()).agree()
    check = next(trial for trial in person.state()["trials"] if trial["kind"] == "attention")
    assert report(person, unstorable(check)).status_code == 202
    assert person.request("POST", "/complete").json()["status"] == "screened_out"


def test_many_refused_records_of_a_run_are_not_kept_whole(
    participant: Participant, services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of a run are read with each answer: their size is bounded together, not only one by one."""
    monkeypatch.setattr("server.participation.refused_records.MAX_WHOLE", 1)
    participant.agree()
    for number in range(3):
        told = refused("/api/run/views", {"number": number, "x": "a" * 9000})
        assert participant.request("POST", "/refused", told).status_code == 202
    with services.database.read() as session:
        kept = [event.data["record"] for event in session.query(RunEvent).filter_by(type="record_refused")]
    assert [list(record) for record in kept] == [["number", "x"], ["left_out_bytes"], ["left_out_bytes"]]


class TestEvidence:
    """No completion code for answers that a person cannot have given."""

    @pytest.fixture
    def services(self, settings: Settings) -> Iterator[Services]:
        opened = open_services(settings.model_copy(update={"evidence": "refuse"}), rehearses=True)
        yield opened
        opened.intake.clips.close()
        opened.database.close()

    def test_a_refused_answer_needs_the_evidence_of_an_accepted_one(
        self, client: Any, study: StudyInDatabase, services: Services
    ) -> None:
        watcher = Watcher(client, study.link_token).begin()
        trial = main_trials(watcher)[0]
        bare = unstorable(trial)
        assert report(watcher, bare).json()["error"]["code"] == "ticket_missing"
        # That no clip was played excuses nobody from having it: a ticket alone would finish a study at once.
        ticket_alone = {name: watcher.evidence(trial)[name] for name in ("batch", "ticket")}
        unseen = bare | {"playback": {"method": "none"}, "evidence": ticket_alone}
        assert report(watcher, unseen).status_code >= 400
        for other in main_trials(watcher)[1:]:
            watcher.answer(other)
        watcher.wait(60)
        false = bare | {"evidence": watcher.evidence(trial, digest="0" * 64)}
        assert report(watcher, false).json()["error"]["code"] == "clip_digest_differs"
        assert report(watcher, bare | {"evidence": watcher.evidence(trial)}).status_code == 202
        with services.database.read() as session:
            assert session.query(RunEvent).filter_by(type="record_refused").count() == 1

    def test_the_verdict_counts_a_refused_attention_check_as_wrong(
        self, client: Any, study: StudyInDatabase, services: Services
    ) -> None:
        """Else a script that cannot read the question would leave it out of its verdict."""
        watcher = Watcher(client, study.link_token).begin()
        first, second = [one for one in watcher.state()["trials"] if one["kind"] == "attention"]
        for trial in main_trials(watcher):
            watcher.wait(10)
            watcher.answer(trial)
        watcher.answer(first, response=asked_for(first)[0])
        with services.database.read() as session:
            assert judge_run(session, session.query(StudyRun).one()).signals.checks == 1
        sent = unstorable(second) | {"evidence": watcher.evidence(second)}
        assert report(watcher, sent).status_code == 202
        with services.database.read() as session:
            signals = judge_run(session, session.query(StudyRun).one()).signals
        assert signals.checks == 0.5
        assert signals.checks_guessed == pytest.approx(1 - (6 / 7) ** 2)

    def test_an_answer_after_a_refused_one_of_the_same_play_is_stored(
        self, client: Any, study: StudyInDatabase, services: Services
    ) -> None:
        """As from another tab, which does not know of the refusal."""
        watcher = Watcher(client, study.link_token).begin()
        trial = main_trials(watcher)[0]
        watcher.wait(60)
        sent = unstorable(trial) | {"evidence": watcher.evidence(trial)}
        assert report(watcher, sent).status_code == 202
        assert watcher.answer(trial).status_code == 201
