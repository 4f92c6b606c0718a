"""The stored comparisons as rows of their view."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import text
from sqlalchemy.orm import Session


def comparisons(session: Session) -> Sequence[Mapping[str, Any]]:
    """Every row of the view, by run, trial and play."""
    query = text("SELECT * FROM comparisons ORDER BY run, trial_index, play")
    return [dict(row) for row in session.execute(query).mappings()]
