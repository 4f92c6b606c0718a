"""What a run's answers took of its time is kept with its counts: the same as summed up from the evidence."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import delete, select, update

from server.context import Services
from server.core.migrate import downgrade, upgrade
from server.models import AnswerEvidence, RunTally, StudyRun
from server.operations import doctor
from server.participation import evidence_repository
from server.participation.tallies import ClipTime
from server.participation.tally_pools import Recount
from tests.helpers.evidence import Watcher
from tests.server.evidence.conftest import CLIP_S

BEFORE = "0026"
START = datetime(2026, 11, 22, 12, tzinfo=UTC)
moments = st.integers(0, 8).map(lambda minutes: START + timedelta(minutes=minutes))
answers = st.tuples(st.floats(0, 60_000), moments, moments)


def kept(of: list[Any]) -> ClipTime:
    made = ClipTime()
    for answer in of:
        made = made.plus(*answer)
    return made


@given(st.lists(answers), st.randoms(), moments)
def test_the_sums_are_those_of_all_answers_in_whatever_order(of: list[Any], random: Any, since: Any) -> None:
    made = kept(of)
    told = made.since(since)
    if told is not None:
        assert told == pytest.approx(sum(clip_ms for clip_ms, issued_at, _ in of if issued_at >= since))
    assert made.last_received_at == max((received_at for *_, received_at in of), default=None)
    random.shuffle(of)
    assert kept(of).same(made)


def test_sums_tell_of_the_first_and_the_newest_tickets_and_later_ones() -> None:
    minutes = [START + timedelta(minutes=minute) for minute in range(5)]
    made = kept([(1_000.0, minutes[0], START), (2_000.0, minutes[2], START), (4_000.0, minutes[3], START)])
    assert [made.since(minute) for minute in minutes] == [7_000, None, None, 4_000, 0]
    assert made.since(START - timedelta(minutes=1)) == 7_000
    assert ClipTime().since(START) == 0


def answered(watcher: Watcher) -> None:
    """Two answers by the first page's tickets, one by those of a reloaded page, one more by the first's."""
    first, second, third, fourth = [one for one in watcher.state()["trials"] if one["clip_sha256"]][:4]
    older = {one["trial_index"]: watcher.evidence(one) for one in (first, second, fourth)}
    for trial in (first, second):
        watcher.wait(CLIP_S + 1)
        assert watcher.answer(trial, older[trial["trial_index"]]).status_code == 201
    watcher.state()
    watcher.wait(CLIP_S + 1)
    assert watcher.answer(third).status_code == 201
    watcher.wait(CLIP_S + 1)
    assert watcher.answer(fourth, older[fourth["trial_index"]]).status_code == 201


def stored(services: Services) -> ClipTime:
    with services.database.read() as session:
        row = session.scalars(select(RunTally)).one()
        return ClipTime(*(getattr(row, name) for name in ClipTime._fields))


def test_what_is_kept_is_what_a_full_count_gives(watcher: Watcher, services: Services) -> None:
    answered(watcher)
    made = stored(services)
    assert made.clip_ms == 4_000 * CLIP_S
    assert made.newest_clip_ms == 1_000 * CLIP_S
    assert made.last_received_at == watcher.moment
    with services.database.read() as session:
        assert list(Recount(services.versions).differing(session)) == []
        run = session.scalars(select(StudyRun.id)).one()
        sums = [
            evidence_repository.clip_ms_since(session.connection(), run, moment)
            for moment in made[2:4]
            if moment
        ]
    assert sums == [made.clip_ms, made.newest_clip_ms]


def test_the_migration_fills_the_sums_from_the_evidence(watcher: Watcher, services: Services) -> None:
    answered(watcher)
    before = stored(services)
    downgrade(services.database, BEFORE)
    upgrade(services.database)
    assert stored(services) == before
    assert before.first_issued_at != before.newest_issued_at


def test_doctor_reports_wrong_sums(watcher: Watcher, services: Services) -> None:
    answered(watcher)
    assert next(doctor.counts(services)).verdict == "ok"
    with services.database.write() as session:
        session.execute(update(RunTally).values(newest_clip_ms=RunTally.newest_clip_ms + 1))
    assert next(doctor.counts(services)).verdict == "failed"


def test_tickets_between_the_first_and_the_newest_are_summed_up(watcher: Watcher) -> None:
    """Three batches; the time is judged for the second one, which the kept sums do not contain."""
    trials = [one for one in watcher.state()["trials"] if one["clip_sha256"]][:4]
    watcher.wait(60)
    assert watcher.answer(trials[0]).status_code == 201
    watcher.state()
    second, too_much = watcher.evidence(trials[1]), watcher.evidence(trials[3])
    watcher.wait(CLIP_S + 1)
    watcher.state()
    third = watcher.evidence(trials[2])
    watcher.wait(CLIP_S + 0.1)
    assert watcher.answer(trials[2], third).status_code == 201
    assert watcher.answer(trials[1], second).status_code == 201
    refused = watcher.answer(trials[3], too_much)
    assert refused.json()["error"]["code"] == "clips_outlast_tickets"


def test_a_run_whose_evidence_was_deleted_is_reported_by_doctor(watcher: Watcher, services: Services) -> None:
    answered(watcher)
    with services.database.write() as session:
        session.execute(delete(AnswerEvidence))
    with services.database.read() as session:
        assert len(list(Recount(services.versions).differing(session))) == 1
