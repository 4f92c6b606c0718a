"""The plays that the server stored, read from its database after the run."""

import json
from typing import Any

from tests.browser.server_process import ServerProcess
from tools.scope.compare import Record

QUERY = """
SELECT t.* FROM trial_ratings t JOIN study_runs r ON r.id = t.study_run_id
WHERE r.id = (SELECT max(id) FROM study_runs) ORDER BY t.time_elapsed
"""


def stored_plays(server: ServerProcess, frames: int, fps: float) -> list[Record]:
    """Every play of the latest run, in the order shown."""
    return [_record(row, frames, fps) for row in server.rows(QUERY)]


def _record(row: dict[str, Any], frames: int, fps: float) -> Record:
    drawn = _json(row["drawn"]) or []
    return Record(
        drawn=tuple((int(index), float(at_ms)) for index, at_ms in drawn),
        frames=frames,
        fps=fps,
        verdict=row["verdict"],
        rule=row["verdict_rule"] or "",
        key_to_first_frame_ms=row["key_to_first_frame_ms"],
        clock_gap_ms=row["clock_gap_ms"],
        clock_late_ms=row["clock_late_ms"],
    )


def _json(value: Any) -> Any:
    return json.loads(value) if isinstance(value, str) else value
