"""Single-clip ratings: means, distributions, response times and playback."""

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.results import service
from server.results.repository import Pool
from server.results.schemas import Results


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> Results:
    """Results on the pool's scale."""
    return service.results(session, study, version, of)
