"""A kind of trial without a summary of its own: how much there is, how it was shown, and that this is all."""

from sqlalchemy.orm import Session

from server.clock import now
from server.models import Study, StudyVersion
from server.results.repository import Pool
from server.results.schemas import OtherResults
from server.results.service import playback_of, time_bins
from server.studies.lookup import definition_of
from server.tallies.pools import pooled


def summarise(session: Session, study: Study, version: StudyVersion, of: Pool) -> OtherResults:
    """Counts alone."""
    kind = definition_of(version).trial.kind
    tally = pooled(session, of.runs(), "", ())
    return OtherResults(
        study=study.name,
        origin=of.origin,
        series=version.series,
        counted_at=now(),
        participants=len(tally.means),
        ratings=tally.answers.total(),
        note=f"Answers of {kind.replace('_', ' ')} trials have no summary here; the Data page exports them.",
        response_times=time_bins(tally),
        playback=playback_of(tally),
    )
