"""Whose data an export holds: one origin, or all of them where they are asked for."""

from typing import Literal, get_args

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from server.models import Study, StudyRun

ExportOrigin = Literal["participant", "pilot", "simulated", "all"]
"""Previews are in no export: they are stored for a day only."""
EXPORTED = get_args(ExportOrigin)[:-1]


def of_origin(study: Study, origin: ExportOrigin) -> ColumnElement[bool]:
    """True for the study's runs of this origin."""
    origins = EXPORTED if origin == "all" else (origin,)
    return (StudyRun.study_id == study.id) & StudyRun.origin.in_(origins)


def runs_by_origin(session: Session, study: Study) -> dict[str, int]:
    """How many runs there are of each exported origin."""
    query = select(StudyRun.origin, func.count()).where(of_origin(study, "all"))
    return dict(session.execute(query.group_by(StudyRun.origin)).all())
