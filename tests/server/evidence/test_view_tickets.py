"""Views carry the ticket of their play; what cannot have begun or been shown so is refused by name."""

import uuid
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from server.context import Services
from server.models import Clip, RunEvent, StudyRun, View
from server.participation import evidence_repository
from server.participation.evidence_repository import ANSWER, VIEW, has_refusals
from tests.helpers.evidence import Watcher
from tests.helpers.studies import StudyInDatabase
from tests.server.evidence.conftest import CLIP_S
from tests.server.evidence.test_intake import SHOWN_S, code, with_clips


@pytest.fixture
def watcher(client: TestClient, study: StudyInDatabase) -> Watcher:
    """A participant whose page brings tickets with views, too."""
    return Watcher(client, study.link_token).begin(view_tickets=True)


def view_of(watcher: Watcher, trial: Any, number: int = 1, **changes: Any) -> dict[str, Any]:
    """A view that begins, with its ticket."""
    given = watcher.evidence(trial, changes.get("play", 1))
    return {
        "id": str(uuid.uuid4()),
        "trial_index": trial["trial_index"],
        "number": number,
        "play": 1,
        "started_at_client": watcher.moment.isoformat(),
        "evidence": {"batch": given["batch"], "ticket": given["ticket"]},
    } | changes


def ended(watcher: Watcher, view: dict[str, Any]) -> dict[str, Any]:
    return view | {"ended_at_client": watcher.moment.isoformat(), "outcome": "shown"}


def seen(sha256: str) -> dict[str, Any]:
    return {"role": "shown", "clip_sha256": sha256, "drawn": [[0, 0.0]]}


def send(watcher: Watcher, *views: dict[str, Any]) -> Any:
    return watcher.request("POST", "/views", {"views": list(views)})


def stored(services: Services) -> list[View]:
    with services.database.read() as session:
        return list(session.scalars(select(View).order_by(View.id)))


def noted(services: Services) -> list[tuple[str, Any]]:
    with services.database.read() as session:
        return [
            (row.type, row.data.get("code"))
            for row in session.scalars(select(RunEvent).order_by(RunEvent.id))
        ]


def test_a_page_may_not_say_that_something_was_refused(watcher: Watcher, services: Services) -> None:
    for refusable in (ANSWER, VIEW):
        for kind in refusable:
            sent = {"id": str(uuid.uuid4()), "type": kind, "data": {"code": "ticket_invalid"}}
            assert code(watcher.request("POST", "/events", {"events": [sent]})) == "422 event_reserved", kind
    assert noted(services) == []
    assert not refused(services)


def refused(services: Services) -> bool:
    with services.database.read() as session:
        return has_refusals(session, session.scalars(select(StudyRun).order_by(StudyRun.id)).all()[0])


def test_views_are_stored_with_the_time_of_their_tickets(watcher: Watcher, services: Services) -> None:
    issued_at = watcher.moment
    for trial in with_clips(watcher.state()):
        view = view_of(watcher, trial)
        assert send(watcher, view).json()["begun"] == 1
        watcher.wait(SHOWN_S)
        assert send(watcher, ended(watcher, view)).json()["completed"] == 1
    views = stored(services)
    assert len(views) == 10
    assert all(
        abs(view.issued_at - issued_at) < timedelta(milliseconds=1) for view in views if view.issued_at
    )
    assert {view.clip_ms for view in views} == {CLIP_S * 1000}
    assert noted(services) == []


Change = Callable[[Watcher, Any, Watcher], dict[str, Any] | None]
FALSE: dict[str, tuple[str, Change]] = {
    "none": ("422 ticket_missing", lambda own, trial, other: None),
    "of another run": (
        "422 ticket_of_another_run",
        lambda own, trial, other: view_of(other, trial)["evidence"],
    ),
    "of another trial": (
        "422 ticket_of_another_trial",
        lambda own, trial, other: view_of(own, with_clips(own.state())[1])["evidence"],
    ),
    "tampered batch": (
        "422 ticket_invalid",
        lambda own, trial, other: view_of(own, trial)["evidence"] | {"batch": "x.1.2.3"},
    ),
    "tampered ticket": (
        "422 ticket_of_another_trial",
        lambda own, trial, other: view_of(own, trial)["evidence"] | {"ticket": "A" * 22},
    ),
}


@pytest.mark.parametrize(("refusal", "change"), FALSE.values(), ids=FALSE.keys())
def test_a_false_ticket_is_refused_in_the_one_shape_and_noted_once(
    watcher: Watcher,
    client: TestClient,
    study: StudyInDatabase,
    services: Services,
    refusal: str,
    change: Change,
) -> None:
    other = Watcher(client, study.link_token).begin(view_tickets=True)
    trial = with_clips(watcher.state())[0]
    false = change(watcher, trial, other)
    for _ in range(3):
        answer = send(watcher, view_of(watcher, trial, evidence=false))
        assert code(answer) == refusal
        assert set(answer.json()["error"]) == {"code", "message", "details"}
    assert stored(services) == []
    assert noted(services) == [("view_refused", refusal[4:])]
    assert refused(services)
    assert send(watcher, view_of(watcher, trial)).status_code == 200


def test_one_false_view_leaves_nothing_of_those_with_it(watcher: Watcher, services: Services) -> None:
    first, second = with_clips(watcher.state())[:2]
    assert send(watcher, view_of(watcher, first), view_of(watcher, second, evidence=None)).status_code == 422
    assert stored(services) == []


def test_an_expired_ticket_is_refused_and_costs_the_run_nothing(watcher: Watcher, services: Services) -> None:
    trial = with_clips(watcher.state())[0]
    old = view_of(watcher, trial)["evidence"]
    watcher.wait(61 * 86_400)
    assert code(send(watcher, view_of(watcher, trial, evidence=old))) == "409 ticket_expired"
    assert noted(services) == [("view_expired", "ticket_expired")]
    assert not refused(services)


def test_a_replayed_ticket_shows_its_clip_no_faster(watcher: Watcher) -> None:
    """The same ticket for view after view of its play: each would have to last as long as the clip."""
    trial = with_clips(watcher.state())[0]
    watcher.wait(SHOWN_S)
    assert send(watcher, ended(watcher, view_of(watcher, trial))).status_code == 200
    again = [ended(watcher, view_of(watcher, trial, number)) for number in (2, 3)]
    assert code(send(watcher, *again)) == "409 clips_outlast_tickets"


def test_views_of_one_call_cannot_outlast_their_tickets(watcher: Watcher, services: Services) -> None:
    trials = with_clips(watcher.state())
    watcher.wait(SHOWN_S)
    answer = send(watcher, *(ended(watcher, view_of(watcher, trial)) for trial in trials))
    assert code(answer) == "409 clips_outlast_tickets"
    assert stored(services) == []


@pytest.mark.parametrize("names_clips", [True, False])
def test_a_view_that_ended_without_an_outcome_takes_its_time_as_well(
    watcher: Watcher, services: Services, names_clips: bool
) -> None:
    trials = with_clips(watcher.state())
    watcher.wait(SHOWN_S)
    whole = [ended(watcher, view_of(watcher, trial)) | {"outcome": None} for trial in trials]
    if names_clips:
        whole = [
            view | {"clips": [seen(trial["clip_sha256"])]} for view, trial in zip(whole, trials, strict=True)
        ]
    assert code(send(watcher, *whole)) == "409 clips_outlast_tickets"
    assert stored(services) == []
    assert send(watcher, whole[0]).json()["completed"] == 1
    assert [view.clip_ms for view in stored(services)] == [CLIP_S * 1000]


def test_the_clips_of_a_view_are_those_of_its_trial(
    watcher: Watcher, services: Services, study: StudyInDatabase
) -> None:
    """Naming the shortest clip of the study costs no less than showing one's own."""
    trials = with_clips(watcher.state())
    own, other = trials[0], next(one for one in trials if one["clip_sha256"] != trials[0]["clip_sha256"])
    with services.database.write() as session:
        session.query(Clip).filter_by(sha256=other["clip_sha256"]).one().frames = 1
    services.versions._loaded.clear()  # a version never changes, so it is read but once
    watcher.wait(SHOWN_S)
    view = ended(watcher, view_of(watcher, own)) | {"clips": [seen(other["clip_sha256"])]}
    assert send(watcher, view).status_code == 200
    assert [row.clip_ms for row in stored(services)] == [CLIP_S * 1000]


def test_what_was_spent_is_read_once_for_the_views_of_a_call(
    watcher: Watcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    trials = with_clips(watcher.state())
    watcher.wait(len(trials) * SHOWN_S)
    whole = [ended(watcher, view_of(watcher, trial)) for trial in trials]
    asked, ask = [], evidence_repository.spent_by_views

    def noted(*question: Any) -> evidence_repository.ViewTime:
        asked.append(question)
        return ask(*question)

    monkeypatch.setattr(evidence_repository, "spent_by_views", noted)
    assert send(watcher, *whole).json()["completed"] == len(trials)
    assert len(asked) == 1


def test_many_batches_do_not_multiply_the_time(watcher: Watcher) -> None:
    trials = with_clips(watcher.state())
    batches = [watcher.state()["tickets"] for _ in trials]
    watcher.wait(SHOWN_S)
    codes = []
    for batch, trial in zip(batches, trials, strict=True):
        watcher.tickets = batch
        codes.append(send(watcher, ended(watcher, view_of(watcher, trial))).status_code)
    assert codes.count(200) == 1


def test_what_the_outbox_sends_again_is_not_judged_again(watcher: Watcher, services: Services) -> None:
    trial = with_clips(watcher.state())[0]
    view = view_of(watcher, trial)
    watcher.wait(SHOWN_S)
    shown = ended(watcher, view)
    assert send(watcher, shown).json()["completed"] == 1
    for _ in range(3):
        assert send(watcher, shown).json() | {"saved_at": None} == {
            "begun": 0,
            "completed": 0,
            "saved_at": None,
        }
    assert noted(services) == []


@pytest.mark.parametrize("years", [-30, 0, 30])
def test_an_hour_offline_with_any_clock_and_a_reload_is_taken(
    watcher: Watcher, services: Services, years: int
) -> None:
    """Everything of two pages arrives at once, with either's tickets, from a clock years off."""
    off = timedelta(days=365 * years)
    kept = []
    for number, trial in enumerate(with_clips(watcher.state())):
        if number == 5:
            watcher.state()
        begun = view_of(watcher, trial, started_at_client=(watcher.moment + off).isoformat())
        watcher.wait(SHOWN_S)
        kept += [begun, ended(watcher, begun) | {"ended_at_client": (watcher.moment + off).isoformat()}]
    watcher.wait(3600)
    for view in kept:
        assert send(watcher, view).status_code == 200
    assert noted(services) == []
    assert all(view.completed and view.issued_at for view in stored(services))


def test_an_outbox_of_months_and_a_server_s_clock_set_back_are_taken(
    watcher: Watcher, services: Services
) -> None:
    first, second = with_clips(watcher.state())[:2]
    watcher.wait(SHOWN_S)
    late = ended(watcher, view_of(watcher, first))
    watcher.wait(90 * 86_400)
    assert send(watcher, late).status_code == 200
    watcher.wait(-91 * 86_400)
    assert send(watcher, ended(watcher, view_of(watcher, second))).status_code == 200
    assert noted(services) == []


def test_a_view_that_a_reload_broke_off_ends_by_the_new_tickets(watcher: Watcher, services: Services) -> None:
    trial = with_clips(watcher.state())[0]
    view = view_of(watcher, trial)
    send(watcher, view)
    watcher.state()
    fresh = view_of(watcher, trial)["evidence"]
    assert send(watcher, view | {"outcome": "interrupted", "evidence": fresh}).json()["completed"] == 1
    assert [row.clip_ms for row in stored(services)] == [None]


def test_a_view_without_a_ticket_is_refused(client: TestClient, study: StudyInDatabase) -> None:
    page = Watcher(client, study.link_token).begin()
    answer = send(page, view_of(page, with_clips(page.state())[0], evidence=None))
    assert code(answer) == "422 ticket_missing"
