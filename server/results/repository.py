"""What the results page reads: the runs of a pool, and what their results depend on."""

from typing import NamedTuple

from sqlalchemy import ColumnElement, Select, and_, func, select
from sqlalchemy.orm import Session

from server.models import Rating, Study, StudyRun, StudyVersion
from server.results.cache import Revision


class Pool(NamedTuple):
    """Which answers are shown together: one study, one origin, one data series, the scale of one name."""

    study_id: int
    origin: str
    series: int
    scale: str

    def runs(self) -> ColumnElement[bool]:
        """True for the runs of this pool."""
        return and_(
            StudyRun.study_id == self.study_id,
            StudyRun.origin == self.origin,
            StudyRun.version_id.in_(self.versions()),
        )

    def versions(self) -> Select[int]:
        """The ids of the versions whose answers may be pooled."""
        return select(StudyVersion.id).where(
            StudyVersion.study_id == self.study_id, StudyVersion.series == self.series
        )


def revision(session: Session, study: Study, of: Pool) -> Revision:
    """What the results of a pool depend on, asked of the runs and the newest rating alone."""
    query = select(
        func.count(),
        func.sum(StudyRun.trials_answered),
        func.count(StudyRun.excluded_at),
        func.max(StudyRun.excluded_at),
        func.count(StudyRun.erased_at),
        func.max(StudyRun.erased_at),
    ).where(of.runs())
    runs, answered, *decisions = session.execute(query).one()
    newest = session.execute(select(Rating.id, Rating.rating_id).order_by(Rating.id.desc()).limit(1)).first()
    # A number is given out again where the newest rating was erased (SQLite), hence the rating's own id.
    return Revision(
        (study.id, study.active_version, *decisions), (runs, answered, tuple(newest) if newest else None)
    )
