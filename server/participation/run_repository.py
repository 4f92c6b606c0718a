"""Reads and writes of links, runs, places and stored comparisons; no rules here."""

from collections import Counter
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta
from typing import Any, Literal, NamedTuple, cast, get_args

from sqlalchemy import (
    ARRAY,
    ColumnElement,
    Select,
    Table,
    and_,
    bindparam,
    delete,
    func,
    insert,
    literal,
    select,
    union_all,
)
from sqlalchemy.orm import Session, aliased

from experiments.assignment import Compared
from server.core.values import hash_token, now
from server.models import (
    NO_SLOT,
    AssignedTrial,
    Calibration,
    FormAnswer,
    Link,
    Rating,
    RunEvent,
    Study,
    StudyRun,
    StudyVersion,
    TrialClip,
    VersionClip,
)
from server.participation.identity_keys import UnreadableError
from server.participation.identity_repository import known_as

# Reads and writes of links and runs; no rules here.

# A table instead of the class: with its hundred rows a run the ORM would take most of the time of a start.
_trials = cast(Table, AssignedTrial.__table__)
_clips = cast(Table, TrialClip.__table__)
_ratings = cast(Table, Rating.__table__)
_calibrations = cast(Table, Calibration.__table__)
_forms = cast(Table, FormAnswer.__table__)

# Read whenever a page begins, and built once: putting such a query together takes longer than its answer.
_LINK = select(Link).where(Link.token_hash == bindparam("token_hash"), Link.revoked_at.is_(None))
_RUN = select(StudyRun).where(StudyRun.token_hash == bindparam("token_hash"))
_LOCKED_RUN = _RUN.with_for_update()
_TRIALS = (
    select(
        _trials.c.trial_index,
        _trials.c.kind,
        _trials.c.block,
        _trials.c.expected_response,
        _clips.c.role,
        _clips.c.version_clip_id,
    )
    .select_from(_trials.outerjoin(_clips))
    .where(_trials.c.study_run_id == bindparam("run"))
    .order_by(_trials.c.trial_index, _clips.c.position)
)
_PLAYS = select(_ratings.c.trial_index, _ratings.c.play, _ratings.c.verdict).where(
    _ratings.c.study_run_id == bindparam("run")
)
_CALIBRATION = (
    select(_calibrations)
    .where(_calibrations.c.study_run_id == bindparam("run"))
    .order_by(_calibrations.c.id.desc())
    .limit(1)
)
_ANSWERED_FORMS = select(_forms.c.form).where(_forms.c.study_run_id == bindparam("run")).order_by(_forms.c.id)
_LINK_KIND = select(Link.kind).where(Link.id == bindparam("link"))


def _unnested_rows(table: Table) -> Any:
    """All rows as one statement of columns (PostgreSQL): row by row they would take four times as long."""
    columns = (func.unnest(bindparam(column.name, type_=ARRAY(column.type))) for column in table.columns)
    return insert(table).from_select(list(table.columns.keys()), select(*columns))


_ADD = {table: (insert(table), _unnested_rows(table)) for table in (_trials, _clips)}


def link_by_token(session: Session, token: str) -> Link | None:
    """The link with this token, withdrawn ones left out."""
    return session.scalar(_LINK, {"token_hash": hash_token(token)})


def run_by_token(session: Session, token: str, *, lock: bool = False) -> StudyRun | None:
    """The run with this token; `lock` keeps other requests of the same run waiting (PostgreSQL)."""
    return session.scalar(_LOCKED_RUN if lock else _RUN, {"token_hash": hash_token(token)})


def lock_study(session: Session, study_id: int) -> Study:
    """The study, held until the transaction ends: one start or completion of it at a time."""
    # FOR NO KEY UPDATE: rows that refer to the study may still be inserted meanwhile.
    query = select(Study).where(Study.id == study_id).with_for_update(key_share=True)
    # A study that this session had read before would keep the status and quota of that moment.
    return session.scalars(query.execution_options(populate_existing=True)).one()


def lock_study_of_run(session: Session, token: str) -> Study | None:
    """The study of the run with this token, held as by `lock_study`; the run itself is not held."""
    study_id = session.scalar(select(StudyRun.study_id).where(StudyRun.token_hash == hash_token(token)))
    return None if study_id is None else lock_study(session, study_id)


def active_version(session: Session, study: Study) -> StudyVersion:
    """The version new runs are made with."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id)
    return session.scalars(query.where(StudyVersion.number == study.active_version)).one()


def active_version_id(session: Session, study: Study) -> int:
    """Id of the version new runs are made with; its declaration and manifest are large and stay unread."""
    query = select(StudyVersion.id).where(StudyVersion.study_id == study.id)
    return session.scalars(query.where(StudyVersion.number == study.active_version)).one()


def versions_of_series(version_id: int) -> Select[int]:
    """The versions whose answers may be pooled with those of this one, itself included."""
    own = select(StudyVersion.study_id, StudyVersion.series).where(StudyVersion.id == version_id).subquery()
    return select(StudyVersion.id).join(
        own, (own.c.study_id == StudyVersion.study_id) & (own.c.series == StudyVersion.series)
    )


def run_of_client(session: Session, link: Link, client_id: str) -> StudyRun | None:
    """The run this browser began through this link."""
    query = select(StudyRun).where(StudyRun.link_id == link.id, StudyRun.client_id == client_id)
    return session.scalar(query)


def latest_run(session: Session, link: Link, participant: str | None = None) -> StudyRun | None:
    """The newest run of a link, or of one participant of it."""
    query = select(StudyRun).where(StudyRun.link_id == link.id).order_by(StudyRun.id.desc()).limit(1)
    return session.scalar(query if participant is None else query.where(StudyRun.participant == participant))


def runs_beginning(session: Session, link: Link, prefix: str) -> Sequence[StudyRun]:
    """The runs of a link whose public id begins so; nearly always one."""
    return session.scalars(
        select(StudyRun).where(StudyRun.link_id == link.id, StudyRun.public_id.startswith(prefix))
    ).all()


def parameters(session: Session, run: StudyRun) -> dict[str, str]:
    """The parameters of the address that led to a run."""
    try:
        known = known_as(session, run)
    except UnreadableError:  # what this person needs them for is not worth an error page
        return {}
    return dict(known.parameters) if known else {}


def add_trials(session: Session, trials: list[dict[str, Any]], clips: list[dict[str, Any]]) -> None:
    """Store a run's trials and their clips, in one statement each."""
    connection = session.connection()
    for table, rows in ((_trials, trials), (_clips, clips)):
        one_by_one, at_once = _ADD[table]
        if not rows:
            continue
        if connection.dialect.name == "postgresql":
            connection.execute(at_once, {name: [row[name] for row in rows] for name in rows[0]})
        else:
            connection.execute(one_by_one, rows)


class StoredTrial(NamedTuple):
    """A trial of a run as it was assigned.

    Attributes
    ----------
    trial_index, block : int
        Its number in the run, and its block's.
    kind : str
        What it is for.
    expected_response : int or None
        Of an attention check.
    clips : dict of str to int
        Their ids by role, in the order of their positions.
    """

    trial_index: int
    kind: Literal["practice", "main", "attention", "check"]
    block: int
    expected_response: int | None
    clips: dict[str, int]


def trials(session: Session, run: StudyRun) -> list[StoredTrial]:
    """The run's trials in order."""
    rows = session.connection().execute(_TRIALS, {"run": run.id})
    stored: list[StoredTrial] = []
    for trial_index, kind, block, expected, role, clip in rows:
        # One row per clip: a trial of several clips comes several times, one without clips once, with nulls.
        if not stored or stored[-1].trial_index != trial_index:
            stored.append(StoredTrial(trial_index, kind, block, expected, {}))
        if role is not None:
            stored[-1].clips[role] = clip
    return stored


def plays(session: Session, run: StudyRun) -> dict[int, list[tuple[int, str]]]:
    """Play number and verdict of every stored play, by trial."""
    by_trial: dict[int, list[tuple[int, str]]] = {}
    for trial_index, play, verdict in session.connection().execute(_PLAYS, {"run": run.id}):
        by_trial.setdefault(trial_index, []).append((play, verdict))
    return by_trial


def latest_calibration(session: Session, run: StudyRun) -> Any:
    """The columns of the calibration that counts; None where there is none."""
    return session.connection().execute(_CALIBRATION, {"run": run.id}).one_or_none()


def calibrations(session: Session, run: StudyRun) -> int:
    """How many calibrations a run has."""
    query = select(func.count()).select_from(Calibration).where(Calibration.study_run_id == run.id)
    return session.scalar(query) or 0


def ended_by(session: Session, run: StudyRun, event: str) -> str | None:
    """The rule by which a run was ended, as the event of this type says; None where it does not."""
    query = select(RunEvent.data).where(RunEvent.study_run_id == run.id, RunEvent.type == event)
    data = session.scalar(query.order_by(RunEvent.id.desc()).limit(1))
    return data.get("rule") if data else None


def events(session: Session, run: StudyRun) -> int:
    """How many events a run has."""
    query = select(func.count()).select_from(RunEvent).where(RunEvent.study_run_id == run.id)
    return session.scalar(query) or 0


def answered_forms(session: Session, run: StudyRun) -> list[str]:
    """Names of the forms that were answered."""
    return list(session.connection().scalars(_ANSWERED_FORMS, {"run": run.id}))


def link_kind(session: Session, run: StudyRun) -> str:
    """The kind of the link that a run began by; the rest of the link stays unread."""
    return str(session.connection().scalar(_LINK_KIND, {"link": run.link_id}))


def form_answer(session: Session, run: StudyRun, form: str) -> FormAnswer | None:
    """The stored answers of one form."""
    query = select(FormAnswer).where(FormAnswer.study_run_id == run.id, FormAnswer.form == form)
    return session.scalar(query)


def delete_previews(session: Session, study: Study, before: datetime) -> None:
    """Delete previews that began earlier, with everything they hold."""
    query = delete(StudyRun).where(
        StudyRun.study_id == study.id, StudyRun.origin == "preview", StudyRun.started_at < before
    )
    session.execute(query)


def add_all(session: Session, rows: Iterable[object]) -> None:
    """Add rows and send them to the database, so that their ids are known."""
    session.add_all(rows)
    session.flush()


# Which places of quotas and which slots of the order plan runs hold; read while the study is held.


def places_taken(session: Session, column: Any, ident: int, origin: str, lease: timedelta) -> int:
    """Runs of this origin that are complete, or active and seen within the lease; `column` equals `ident`."""
    query = select(func.count()).select_from(StudyRun).where(column == ident, *_slot_holders(now() - lease))
    return session.scalar(query.where(StudyRun.origin == origin)) or 0


def places_by_group(session: Session, version_id: int, origin: str, lease: timedelta) -> Counter[str]:
    """Places taken as `places_taken` counts them, by group, in the data series of a version."""
    query = select(StudyRun.group_name, func.count()).where(
        StudyRun.version_id.in_(versions_of_series(version_id)),
        StudyRun.origin == origin,
        *_slot_holders(now() - lease),
    )
    return Counter(dict(session.execute(query.group_by(StudyRun.group_name)).all()))


def complete_runs(session: Session, study: Study, origin: str) -> int:
    """Complete runs of this origin, excluded ones not counted."""
    query = (
        select(func.count())
        .select_from(StudyRun)
        .where(
            StudyRun.study_id == study.id,
            StudyRun.status == "complete",
            StudyRun.origin == origin,
            StudyRun.excluded.is_(False),
        )
    )
    return session.scalar(query) or 0


def free_slot(session: Session, version_id: int, origin: str, lease: timedelta) -> int:
    """The smallest slot that no run holds which is complete, or active and seen within the lease.

    The database looks for it: with thousands of runs, fetching their slots would take most of a start's time.
    """
    values = {"version": version_id, "origin": origin, "seen_after": now() - lease}
    return session.connection().scalar(_FREE_SLOT, values) or 0


def _slot_holders(seen_after: Any) -> tuple[Any, ...]:
    alive = (StudyRun.status == "active") & (StudyRun.last_seen_at > seen_after)
    return (
        StudyRun.excluded.is_(False),
        (StudyRun.status == "complete") | alive,
    )


def _slots_held(version: Any, origin: Any, seen_after: Any) -> Select[int]:
    """The slots that runs hold; those that have none yet stay aside."""
    return select(StudyRun.slot).where(
        StudyRun.version_id == version,
        StudyRun.origin == origin,
        StudyRun.slot != NO_SLOT,
        *_slot_holders(seen_after),
    )


def _free_slot_statement() -> Any:
    taken = _slots_held(bindparam("version"), bindparam("origin"), bindparam("seen_after")).cte("taken")
    # The smallest free slot is 0 or follows a held one: no other number has to be looked at.
    candidates = union_all(select(literal(0).label("slot")), select(taken.c.slot + 1)).subquery()
    return select(func.min(candidates.c.slot)).where(candidates.c.slot.not_in(select(taken.c.slot)))


# Built once: the expressions cost a start more than the database's answer does.
_FREE_SLOT = _free_slot_statement()


def free_slot_of(
    session: Session, version_id: int, origin: str, lease: timedelta, groups: int, turns: Sequence[int]
) -> int:
    """As `free_slot`, among the slots that are one of `turns` modulo `groups`."""
    taken = (
        _slots_held(version_id, origin, now() - lease).where((StudyRun.slot % groups).in_(turns)).cte("taken")
    )
    # The first slot of each group, or the next one of a group after a slot that is held.
    firsts = [select(literal(turn).label("slot")) for turn in turns]
    candidates = union_all(*firsts, select(taken.c.slot + groups)).subquery()
    free = select(func.min(candidates.c.slot)).where(candidates.c.slot.not_in(select(taken.c.slot)))
    return session.scalar(free) or 0


# The stored comparisons of a data series, for designs that choose the next pairs by them.

Winner = Literal["left", "right", "tie"]


def compared_answers(session: Session, version_id: int, origin: str, lease: timedelta) -> list[Compared]:
    """What was answered, and what was dealt to people seen within the lease who have not answered it yet.

    Of runs of this origin that are not excluded; failed plays are not answers. Ordered, so that equal stored
    comparisons give an equal list.
    """
    first, second = aliased(TrialClip), aliased(TrialClip)
    winner = Rating.payload["winner"].as_string().label("winner")
    alive = and_(StudyRun.status == "active", StudyRun.last_seen_at > now() - lease)
    query = (
        select(first.version_clip_id, second.version_clip_id, winner, func.count())
        .select_from(StudyRun)
        .join(AssignedTrial, AssignedTrial.study_run_id == StudyRun.id)
        .join(first, _of_trial(first, 0))
        .join(second, _of_trial(second, 1))
        # Outer: a pair that was dealt and not answered yet is in the design already, without a winner.
        .outerjoin(
            Rating,
            and_(
                Rating.study_run_id == AssignedTrial.study_run_id,
                Rating.trial_index == AssignedTrial.trial_index,
                Rating.verdict != "failed",
            ),
        )
        .where(
            StudyRun.version_id.in_(versions_of_series(version_id)),
            StudyRun.origin == origin,
            StudyRun.excluded.is_(False),
            StudyRun.status.in_(("active", "complete")),
            AssignedTrial.kind == "main",
            Rating.id.is_not(None) | alive,
        )
        .group_by(first.version_clip_id, second.version_clip_id, "winner")
    )
    names = _names(session, version_id)
    rows = [
        Compared(names[left], names[right], answer if answer in get_args(Winner) else None, times)
        for left, right, answer, times in session.execute(query)
    ]
    return sorted(rows, key=lambda row: (row.left, row.right, row.winner or ""))


def _of_trial(clip: type[TrialClip], position: int) -> ColumnElement[bool]:
    return and_(
        clip.study_run_id == AssignedTrial.study_run_id,
        clip.trial_index == AssignedTrial.trial_index,
        clip.position == position,
    )


def _names(session: Session, version_id: int) -> dict[int, str]:
    """Clips of the series as lists name them; the versions of a series show the same clips."""
    query = select(VersionClip.id, VersionClip.cell, VersionClip.exemplar)
    rows = session.execute(query.where(VersionClip.version_id.in_(versions_of_series(version_id))))
    return {number: f"{cell}/{exemplar}" for number, cell, exemplar in rows}
