"""Reads and writes of views; those that come with every view are made ready once."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, NamedTuple, cast

from sqlalchemy import Connection, String, Table, Text, bindparam, func, insert, select, true, update
from sqlalchemy.orm import Session

from server.core.commit import Prepared, Query
from server.models import AssignedTrial, Rating, SeriesOffer, StudyRun, TrialClip, View, ViewClip

_runs, _views, _view_clips, _trials, _clips, _offers = (
    cast(Table, one.__table__) for one in (StudyRun, View, ViewClip, AssignedTrial, TrialClip, SeriesOffer)
)
_NUMBERS = (
    select(_views.c.trial_index, func.max(_views.c.number))
    .where(_views.c.study_run_id == bindparam("run"))
    .group_by(_views.c.trial_index)
)


class RunOfViews(NamedTuple):
    """The columns of a run that its views need."""

    id: int
    public_id: str
    origin: str
    evidence: str
    version_id: int
    consented_at: datetime | None
    trials_total: int
    view_tickets: bool


class StoredView(NamedTuple):
    """What is known of a stored view when more of it comes."""

    view_id: str
    trial_index: int
    number: int
    completed: bool


class TrialClips(NamedTuple):
    """The ids of a trial's clips by their roles; `is_check` where it is a motion check."""

    by_role: dict[str, int]
    is_check: bool


_RUN = Query(
    select(*(_runs.c[name] for name in RunOfViews._fields))
    .where(_runs.c.token_hash == bindparam("token_hash"))
    .with_for_update(),
    RunOfViews._make,
)
_OF_TRIAL = Query(
    select(_views.c.view_id, _trials.c.trial_index, _views.c.number, _views.c.completed)
    # Outer: a trial without views is known from one that does not exist.
    .select_from(_trials.outerjoin(_views))
    .where(_trials.c.study_run_id == bindparam("run"), _trials.c.trial_index == bindparam("trial")),
    StoredView._make,
)
_CLIPS_OF_TRIAL = Query[tuple[str, int, str]](
    select(_clips.c.role, _clips.c.version_clip_id, _trials.c.kind)
    .select_from(_clips.join(_trials))
    .where(_clips.c.study_run_id == bindparam("run"), _clips.c.trial_index == bindparam("trial")),
    tuple,
)
_CLIPS_CHOSEN = Query[tuple[int]](
    select(_offers.c.version_clip_id).where(
        _offers.c.study_run_id == bindparam("run"), _offers.c.trial_index == bindparam("trial")
    ),
    tuple,
)
_BEGUN = (
    "view_id",
    "study_run_id",
    "trial_index",
    "number",
    "play",
    "started_at_client",
    "received_at",
    "completed",
    "screen",
    "disturbances",
    "issued_at",
)
_BEGIN = Prepared(insert(_views).inline(), _BEGUN)
_ENDED = ("ended_at_client", "outcome", "disturbances", "showings", "clip_ms")
_COMPLETE = Prepared(
    update(_views)
    .where(_views.c.study_run_id == bindparam("run"), _views.c.view_id == bindparam("view"))
    .values(completed=true(), **{name: bindparam(name) for name in _ENDED})
)
# From a select: the number of the view is looked up in the same statement.
_ADD_CLIP = Prepared(
    insert(_view_clips).from_select(
        ["view", "role", "clip_sha256", "frame_log"],
        select(
            _views.c.id,
            # Types are named, as a select of bare parameters has none for PostgreSQL.
            bindparam("role", type_=String),
            bindparam("sha256", type_=String),
            bindparam("log", type_=Text),
        ).where(_views.c.study_run_id == bindparam("run"), _views.c.view_id == bindparam("of_view")),
    )
)
_SEEN = Prepared(update(_runs).where(_runs.c.id == bindparam("run")).values(last_seen_at=bindparam("seen")))


def run_of_views(connection: Connection, token_hash: str) -> RunOfViews | None:
    """The run with this token, None where there is none. Locks it (PostgreSQL)."""
    return _RUN.one_or_none(connection, {"token_hash": token_hash})


def stored_views(connection: Connection, run: int, trial: int) -> list[StoredView] | None:
    """The views stored of a trial; None where the run has no such trial."""
    rows = _OF_TRIAL.all(connection, {"run": run, "trial": trial})
    if not rows:
        return None
    # The outer join gives a trial without views one row of nulls.
    return [row for row in rows if row.view_id is not None]


def clips_of_trial(connection: Connection, run: int, trial: int) -> TrialClips:
    """A trial's clips, and whether it is a motion check."""
    rows = _CLIPS_OF_TRIAL.all(connection, {"run": run, "trial": trial})
    # Every row repeats the kind of the trial.
    return TrialClips({role: ident for role, ident, _ in rows}, any(kind == "check" for _, _, kind in rows))


def clips_chosen(connection: Connection, run: int, trial: int) -> list[int]:
    """The ids of every clip that answers have ever chosen for a trial."""
    return [ident for (ident,) in _CLIPS_CHOSEN.all(connection, {"run": run, "trial": trial})]


def begin(connection: Connection, values: dict[str, Any]) -> None:
    """Store a view that begins."""
    _BEGIN.run(connection, values)


def complete(connection: Connection, run: int, view_id: str, values: dict[str, Any]) -> None:
    """Store what is known of a view when it has ended."""
    _COMPLETE.run(connection, {"run": run, "view": view_id, **values})


def add_clip(connection: Connection, run: int, view_id: str, role: str, sha256: str, log: str) -> None:
    """Store a clip of a view that has ended."""
    values = {"run": run, "of_view": view_id, "role": role, "sha256": sha256, "log": log}
    _ADD_CLIP.run(connection, values)


def mark_seen(connection: Connection, run: int, seen: datetime) -> None:
    """Note when the run was last seen."""
    _SEEN.run(connection, {"run": run, "seen": seen})


def numbers(session: Session, run: StudyRun) -> dict[int, int]:
    """The highest number of a view of each trial that has any."""
    rows = session.connection().execute(_NUMBERS, {"run": run.id})
    return dict(rows.all())


def unanswered_views(session: Session, run: StudyRun) -> Sequence[View]:
    """Views of plays that have no answer, in the order of their trials and numbers."""
    # A play, not a trial: an answer to play 1 leaves the views of play 2 waiting.
    answered = select(Rating.id).where(
        Rating.study_run_id == View.study_run_id,
        Rating.trial_index == View.trial_index,
        Rating.play == View.play,
    )
    query = select(View).where(View.study_run_id == run.id, ~answered.exists())
    return session.scalars(query.order_by(View.trial_index, View.number)).all()


def clips_of(session: Session, views: Iterable[View]) -> dict[int, list[ViewClip]]:
    """The clips of each of these views."""
    by_view: dict[int, list[ViewClip]] = {}
    # One query for all views.
    for clip in session.scalars(select(ViewClip).where(ViewClip.view.in_([view.id for view in views]))):
        by_view.setdefault(clip.view, []).append(clip)
    return by_view
