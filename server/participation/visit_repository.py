"""Runs and all that belongs to them."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, Select, delete, false, func, select
from sqlalchemy.orm import Session, joinedload

from server.core.errors import NotFound
from server.models import (
    AnswerEvidence,
    AssignedTrial,
    Calibration,
    FormAnswer,
    Job,
    Rating,
    RunEvent,
    RunTally,
    SeriesAnswer,
    SeriesOffer,
    SeriesTrial,
    Study,
    StudyRun,
    StudyVersion,
    TrialClip,
    VersionClip,
    View,
)
from server.participation import identity_repository as identities
from server.participation.rating_repository import REFUSED
from server.results.schemas import Show


def find_run(session: Session, study: Study, public_id: str, *, lock: bool = False) -> StudyRun:
    """The run of a study by its public identifier, held where `lock`; previews are not runs of people."""
    query = select(StudyRun).where(StudyRun.study_id == study.id, StudyRun.public_id == public_id)
    query = query.where(StudyRun.origin != "preview")
    # Only the run itself is locked, not rows that are loaded with it.
    run = session.scalar(query.with_for_update(of=StudyRun) if lock else query)
    if run is None:
        # Shortened: the id comes from the address and may be of any length.
        raise NotFound(f"There is no run '{public_id[:40]}' in the study '{study.name}'.")
    return run


_SHOWN: dict[Show, tuple[ColumnElement[bool], ...]] = {
    "everybody": (),
    "complete": (StudyRun.status == "complete",),
    "not_complete": (StudyRun.status != "complete",),
    "excluded": (StudyRun.excluded.is_(True),),
    "pilot": (StudyRun.origin == "pilot",),
    "simulated": (StudyRun.origin == "simulated",),
}


def _shown_runs(
    session: Session, study: Study, show: Show, search: str, *, simulated: bool
) -> Select[StudyRun]:
    """The runs of a study but previews that are to be shown; those of simulated people where asked for."""
    # The choice "simulated" would otherwise show an empty list.
    left_out = ("preview",) if simulated or show == "simulated" else ("preview", "simulated")
    query = select(StudyRun).where(
        StudyRun.study_id == study.id, StudyRun.origin.not_in(left_out), *_SHOWN[show]
    )
    return query.where(_search_condition(session, search)) if search else query


def _search_condition(session: Session, search: str) -> ColumnElement[bool]:
    """Which runs have a text in their participant or their public id, large or small letters.

    Every run is looked at, so it is done as the database does fastest: SQLite's LIKE folds what is ASCII
    itself, where lower() is a call of Python a run, and public ids have no large letters.
    """
    folds = session.get_bind().dialect.name == "sqlite" and search.isascii()
    contains = StudyRun.participant.contains if folds else StudyRun.participant.icontains
    # `autoescape`: % and _ in the text are searched for as they are.
    in_id = StudyRun.public_id.contains(search.lower(), autoescape=True)
    return contains(search, autoescape=True) | in_id


def number_of_runs(session: Session, study: Study, show: Show, search: str, *, simulated: bool) -> int:
    """How many runs are to be shown."""
    query = _shown_runs(session, study, show, search, simulated=simulated)
    return session.scalar(query.with_only_columns(func.count())) or 0


def page_of_runs(
    session: Session,
    study: Study,
    show: Show,
    search: str,
    before: int | None,
    limit: int,
    *,
    simulated: bool,
) -> list[StudyRun]:
    """At most `limit` runs, the latest first, those begun before the run with the number `before`."""
    query = _shown_runs(session, study, show, search, simulated=simulated)
    query = query.order_by(StudyRun.id.desc()).limit(limit)
    # Both are shown in every row; loading them one by one would take a query for each run.
    query = query.options(
        joinedload(StudyRun.link), joinedload(StudyRun.version).load_only(StudyVersion.number)
    )
    # By number and not by offset: runs that begin meanwhile move no page.
    return list(session.scalars(query if before is None else query.where(StudyRun.id < before)))


def answered_trials(session: Session, runs: Sequence[int]) -> dict[int, tuple[set[int], int]]:
    """Run number -> (trials answered, plays that were flagged or failed); for one page of runs."""
    query = select(RunTally.study_run_id, RunTally.heat, RunTally.not_good)
    rows = session.execute(query.where(RunTally.study_run_id.in_(runs)))
    # The heat has a character for each trial, a dot where there is no answer.
    return {
        run: ({trial for trial, letter in enumerate(heat) if letter != "."}, not_good)
        for run, heat, not_good in rows
    }


def refused_records(session: Session, runs: Sequence[int]) -> dict[int, int]:
    """Run number -> records that could not be stored, where there are any; for one page of runs."""
    query = select(RunEvent.study_run_id, func.count()).where(
        RunEvent.study_run_id.in_(runs), RunEvent.type == REFUSED
    )
    rows = session.execute(query.group_by(RunEvent.study_run_id))
    return {run: number for run, number in rows if run is not None}


def plays(session: Session, run: StudyRun) -> list[tuple[Rating, AssignedTrial, VersionClip | None]]:
    """Every stored play of a run with its trial and its first clip, in the order they were stored."""
    query = (
        select(Rating, AssignedTrial, VersionClip)
        .join(
            AssignedTrial,
            (AssignedTrial.study_run_id == Rating.study_run_id)
            & (AssignedTrial.trial_index == Rating.trial_index),
        )
        .outerjoin(
            TrialClip,
            (TrialClip.study_run_id == Rating.study_run_id)
            & (TrialClip.trial_index == Rating.trial_index)
            # The first clip names the trial in lists; trials of several clips would give several rows.
            & (TrialClip.position == 0),
        )
        .outerjoin(VersionClip, VersionClip.id == TrialClip.version_clip_id)
        .where(Rating.study_run_id == run.id)
        .order_by(Rating.id)
    )
    return [(rating, trial, clip) for rating, trial, clip in session.execute(query)]


def clips_by_trial(session: Session, run: StudyRun) -> dict[int, list[tuple[str, VersionClip]]]:
    """The clips of each trial of a run with their roles, in the order in which the trial has them."""
    query = (
        select(TrialClip, VersionClip)
        .join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
        .where(TrialClip.study_run_id == run.id)
        .order_by(TrialClip.trial_index, TrialClip.position)
    )
    by_trial: dict[int, list[tuple[str, VersionClip]]] = {}
    for one, clip in session.execute(query):
        by_trial.setdefault(one.trial_index, []).append((one.role, clip))
    return by_trial


def events(session: Session, run: StudyRun) -> list[RunEvent]:
    """The events of a run in the order they came, heartbeats left out."""
    # Heartbeats come every 20 s and say only that the page was open.
    query = select(RunEvent).where(RunEvent.study_run_id == run.id, RunEvent.type != "heartbeat")
    return list(session.scalars(query.order_by(RunEvent.id)))


def forms(session: Session, run: StudyRun) -> list[FormAnswer]:
    """The form answers of a run."""
    return list(session.scalars(select(FormAnswer).where(FormAnswer.study_run_id == run.id)))


def calibrations(session: Session, run: StudyRun) -> list[Calibration]:
    """The calibrations of a run, in the order they were made."""
    query = select(Calibration).where(Calibration.study_run_id == run.id).order_by(Calibration.id)
    return list(session.scalars(query))


def every_visit(session: Session, runs: Sequence[StudyRun], *, lock: bool = False) -> list[StudyRun]:
    """All visits to the study that are known to be the person's of these runs, not erased, these first.

    Known are those by the same personal link and those under the same recruiter's ID, and what is known by
    these in turn. Previews are nobody's.
    """
    known, news = {run.id: run for run in runs}, list(runs)
    # In turn: a run found by its link may have another recruiter's ID, and so on.
    while news:
        further = [other for run in news for other in _of_same_person(session, run, lock=lock)]
        news = list({other.id: other for other in further if other.id not in known}.values())
        known |= {other.id: other for other in news}
    given = {run.id for run in runs}
    others = sorted((run for run in known.values() if run.id not in given), key=lambda run: run.id)
    return [*runs, *others]


def _of_same_person(session: Session, run: StudyRun, *, lock: bool) -> list[StudyRun]:
    # A general link is shared by many people and identifies nobody.
    same: ColumnElement[bool] = StudyRun.link_id == run.link_id if run.link.kind == "personal" else false()
    hashed = identities.same_person(session, run)
    if hashed is not None:
        same |= hashed
    query = select(StudyRun).where(StudyRun.study_id == run.study_id, same, StudyRun.origin != "preview")
    # In one order, so that two requests that lock the same visits do not wait for each other.
    query = query.where(StudyRun.erased_at.is_(None)).order_by(StudyRun.id)
    return list(session.scalars(query.with_for_update(of=StudyRun) if lock else query))


def reports(session: Session, study: Study) -> list[tuple[str, datetime | None]]:
    """Reports of a study that are kept: public id and when they were finished."""
    query = select(Job.public_id, Job.finished_at).where(Job.study_id == study.id, Job.status == "done")
    return [(public_id, finished) for public_id, finished in session.execute(query.order_by(Job.id))]


def of_personal_link(run: StudyRun) -> ColumnElement[bool]:
    """Which events came by the link of one person alone, before a run began."""
    by_link = RunEvent.study_run_id.is_(None) & (RunEvent.link_id == run.link_id)
    return by_link if run.link.kind == "personal" else false()


def delete_personal_rows(session: Session, run: StudyRun) -> int:
    """Delete everything a person left in a run; return how many ratings that were."""
    ratings = session.scalar(select(func.count()).select_from(Rating).where(Rating.study_run_id == run.id))
    identities.forget(session, run)
    personal = (AnswerEvidence, View, RunEvent, FormAnswer, Calibration)
    # Which clips were shown follows from the group, and in a series from the answers.
    shown = (SeriesAnswer, SeriesOffer, SeriesTrial, TrialClip)
    # The row of the run stays; `server.privacy.erasures` empties what identifies the person.
    for table in (Rating, RunTally, *personal, *shown):
        session.execute(delete(table).where(table.study_run_id == run.id))
    session.execute(delete(RunEvent).where(of_personal_link(run)))
    return int(ratings or 0)
