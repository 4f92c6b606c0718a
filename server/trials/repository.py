"""Reads and writes of one rating, in as few statements as it takes."""

from datetime import datetime
from typing import Any

from sqlalchemy import bindparam, insert, or_, select, update
from sqlalchemy.orm import Session

from server.models import AssignedTrial, Rating, StudyRun

# Built once: putting a statement together costs more than running it.
_RUN = select(
    StudyRun.id,
    StudyRun.version_id,
    StudyRun.status,
    StudyRun.consented_at,
    StudyRun.px_per_mm,
    StudyRun.viewing_distance_mm,
    StudyRun.trials_total,
    StudyRun.trials_answered,
    StudyRun.elapsed_ms,
).where(StudyRun.token_hash == bindparam("token_hash"))
_RUN_LOCKED = _RUN.with_for_update()
_TRIAL = select(AssignedTrial.kind, AssignedTrial.version_clip_id).where(
    AssignedTrial.study_run_id == bindparam("run"), AssignedTrial.trial_index == bindparam("trial_index")
)
_STORED = select(
    Rating.rating_id,
    Rating.trial_index,
    Rating.play,
    Rating.response,
    Rating.verdict,
    Rating.verdict_rule,
    Rating.saved_at,
).where(
    Rating.study_run_id == bindparam("run"),
    or_(Rating.trial_index == bindparam("trial_index"), Rating.rating_id == bindparam("rating_id")),
)
_INSERT = insert(Rating)
_TABLE = StudyRun.__table__
_SEEN = (
    update(_TABLE)  # type: ignore[arg-type]
    .where(_TABLE.c.id == bindparam("run"))
    .values(
        last_seen_at=bindparam("seen"),
        elapsed_ms=bindparam("elapsed"),
        trials_answered=_TABLE.c.trials_answered + bindparam("answered"),
    )
)


def run_for_rating(session: Session, token_hash: str) -> Any:
    """The columns of the run that a rating needs; None where no run has this token. Locks it (PostgreSQL)."""
    return session.execute(_RUN_LOCKED, {"token_hash": token_hash}).one_or_none()


def trial(session: Session, run: int, trial_index: int) -> Any:
    """Kind and clip of a trial; None where the run has no such trial."""
    return session.execute(_TRIAL, {"run": run, "trial_index": trial_index}).one_or_none()


def stored_ratings(session: Session, run: int, trial_index: int, rating_id: str) -> list[Any]:
    """Ratings of this trial, and the one with this id."""
    values = {"run": run, "trial_index": trial_index, "rating_id": rating_id}
    return list(session.execute(_STORED, values).all())


def add_rating(session: Session, values: dict[str, Any]) -> None:
    """Store one rating."""
    session.execute(_INSERT, [values])


def mark_seen(session: Session, run: int, seen: datetime, elapsed_ms: float, answered: int) -> None:
    """Note when the run was last seen, how far its clock is, and how many trials were settled now."""
    session.execute(_SEEN, {"run": run, "seen": seen, "elapsed": elapsed_ms, "answered": answered})
