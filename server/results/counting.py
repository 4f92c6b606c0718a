"""Results of a pool together with what they depend on."""

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.results import repository, service
from server.results.cache import Revision
from server.results.kinds import summary_of
from server.results.repository import Pool
from server.results.schemas import AnyResults
from server.studies.lookup import definition_of
from server.studies.series import version_of_series


def pool_and_revision(
    session: Session, study: Study, origin: str, series: int | None, scale: str | None
) -> tuple[Pool, StudyVersion, Revision]:
    """What results are asked of, with a version of it, and what they depend on at this moment."""
    version = version_of_series(session, study, series)
    pool = service.pool(study, version, origin, scale)
    return pool, version, repository.revision(session, study, pool)


def counted(
    session: Session, study: Study, origin: str, series: int | None, scale: str | None
) -> tuple[Revision, AnyResults]:
    """The results with the revision they are of."""
    # The revision is read first: a rating that comes in between is counted again, never left out.
    pool, version, revision = pool_and_revision(session, study, origin, series, scale)
    summarise = summary_of(definition_of(version).trial.kind)
    return revision, summarise(session, study, version, pool)
