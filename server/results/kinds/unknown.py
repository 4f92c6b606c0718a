"""A kind of trial without a summary of its own: how much there is, how it was shown, and that this is all."""

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.participation.tally_pools import pooled
from server.results.repository import Pool
from server.results.schemas import OtherResults
from server.results.service import common
from server.studies.lookup import definition_of


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> OtherResults:
    """Counts alone."""
    kind = definition_of(version).trial.kind
    tally = pooled(session, of.runs(), "", ())
    return OtherResults(
        **common(study, version, of, tally),
        ratings=tally.answers.total(),
        note=f"Answers of {kind.replace('_', ' ')} trials have no summary here; the Data page exports them.",
    )
