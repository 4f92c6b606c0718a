"""The heat map participants x trials, kept up to date from new ratings alone.

One letter a trial: `.` not answered, `g` good, `u` uncertain, `f` flagged, `x` failed, not yet shown again.
"""

import threading
from collections.abc import Iterable
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.models import Rating, StudyRun

LETTERS = {"good": "g", "uncertain": "u", "flagged": "f", "failed": "x"}
_BETTER = {".": 0, "x": 1, "f": 2, "u": 3, "g": 4}
# Two transactions may commit in another order than they took their numbers; read a few again.
_READ_AGAIN = 200


class HeatMap:
    """The rows of one study; `update` reads only ratings stored since the last call."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._last: tuple[int, str] | None = None
        self._rows: dict[str, list[str]] = {}

    def update(self, session: Session, study_id: int) -> set[str]:
        """Read new ratings; return the runs (their public ids) whose row changed."""
        with self._lock:
            if not self._is_up_to_date(session):
                self._last = None
                self._rows.clear()
            query = (
                select(Rating.id, Rating.rating_id, StudyRun.public_id, Rating.trial_index, Rating.verdict)
                .join(StudyRun, StudyRun.id == Rating.study_run_id)
                .where(StudyRun.study_id == study_id)
                .order_by(Rating.id)
            )
            if self._last is not None:
                query = query.where(Rating.id > self._last[0] - _READ_AGAIN)
            return self._take(session.execute(query))

    def _is_up_to_date(self, session: Session) -> bool:
        """False where the last rating read is gone: SQLite then gives its number to another one."""
        if self._last is None:
            return True
        number, rating_id = self._last
        return session.scalar(select(Rating.rating_id).where(Rating.id == number)) == rating_id

    def _take(self, rows: Iterable[Any]) -> set[str]:
        changed = set()
        for number, rating_id, run, trial, verdict in rows:
            cells = self._rows.setdefault(run, [])
            if len(cells) <= trial:
                cells.extend("." * (trial + 1 - len(cells)))
            letter = LETTERS[verdict]
            if _BETTER[letter] > _BETTER[cells[trial]]:
                cells[trial] = letter
                changed.add(run)
            self._last = (number, rating_id)
        return changed

    def row(self, run: str, trials: int) -> str:
        """The letters of one run (its public id), one for each of its trials."""
        return "".join(self._rows.get(run, [])).ljust(trials, ".")[:trials]


class HeatMaps:
    """One heat map a study, in the memory of this worker."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._maps: dict[int, HeatMap] = {}

    def of(self, study_id: int) -> HeatMap:
        """The heat map of a study, made at first use."""
        with self._lock:
            return self._maps.setdefault(study_id, HeatMap())
