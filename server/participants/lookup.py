"""The run a token stands for."""

from sqlalchemy.orm import Session

from server.clock import now
from server.models import StudyRun
from server.participants import repository
from server.trials.refusals import RunClosed, RunUnknown


def find_run(session: Session, token: str, *, lock: bool = False) -> StudyRun:
    """The run with this token, or RunUnknown."""
    run = repository.run_by_token(session, token, lock=lock)
    if run is None:
        raise RunUnknown(
            "This visit is not known; please open the link you were given again.",
            headers={"www-authenticate": "Bearer"},
        )
    return run


def open_run(session: Session, token: str) -> StudyRun:
    """The run with this token, marked as seen; RunClosed where it is over."""
    run = find_run(session, token, lock=True)
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    run.last_seen_at = now()
    return run
