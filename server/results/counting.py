"""Results of a pool together with what they depend on."""

from sqlalchemy.orm import Session

from server.models import Study
from server.results import repository, service
from server.results.cache import Revision
from server.results.kinds import summary_of
from server.results.repository import Pool
from server.results.schemas import AnyResults
from server.studies.lookup import definition_of
from server.studies.series import version_of_series


def pool_and_revision(
    session: Session, study: Study, origin: str, series: int | None, scale: str | None
) -> tuple[Pool, Revision]:
    """What results are asked of, and what they depend on at this moment."""
    pool = service.pool(study, version_of_series(session, study, series), origin, scale)
    return pool, repository.revision(session, study, pool)


def counted(
    session: Session, study: Study, origin: str, series: int | None, scale: str | None
) -> tuple[Revision, AnyResults]:
    """The results with the revision they are of."""
    # The revision is read first: a rating that comes in between is counted again, never left out.
    version = version_of_series(session, study, series)
    pool = service.pool(study, version, origin, scale)
    summarise = summary_of(definition_of(version).trial.kind)
    return repository.revision(session, study, pool), summarise(session, study, version, pool)
