"""The heat map participants x trials, kept up to date from new ratings alone.

One letter a trial: `.` not answered, `g` good, `f` flagged, `x` failed and not yet shown again.
"""

import threading
from collections.abc import Iterable

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.models import Rating, StudyRun

LETTERS = {"good": "g", "flagged": "f", "failed": "x"}
_BETTER = {".": 0, "x": 1, "f": 2, "g": 3}
# Two transactions may commit in another order than they took their numbers; read a few again.
_READ_AGAIN = 200


class HeatMap:
    """The rows of one study; `update` reads only ratings stored since the last call."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._last_id = 0
        self._rows: dict[int, list[str]] = {}

    def update(self, session: Session, study_id: int) -> set[int]:
        """Read new ratings; return the run numbers whose row changed."""
        with self._lock:
            query = (
                select(Rating.id, Rating.study_run_id, Rating.trial_index, Rating.verdict)
                .join(StudyRun, StudyRun.id == Rating.study_run_id)
                .where(StudyRun.study_id == study_id, Rating.id > self._last_id - _READ_AGAIN)
                .order_by(Rating.id)
            )
            return self._take(session.execute(query))

    def _take(self, rows: Iterable[tuple[int, int, int, str]]) -> set[int]:
        changed = set()
        for number, run, trial, verdict in rows:
            cells = self._rows.setdefault(run, [])
            if len(cells) <= trial:
                cells.extend("." * (trial + 1 - len(cells)))
            letter = LETTERS[verdict]
            if _BETTER[letter] > _BETTER[cells[trial]]:
                cells[trial] = letter
                changed.add(run)
            self._last_id = max(self._last_id, number)
        return changed

    def row(self, run: int, trials: int) -> str:
        """The letters of one run, one for each of its trials."""
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
