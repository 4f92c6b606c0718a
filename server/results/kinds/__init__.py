"""What the results page shows of each kind of trial: a file of its name here, with `summarise`.

Nothing else joins them: the name in the declaration finds the file. A kind without one says so in a line.
"""

from collections.abc import Callable
from importlib import import_module

from sqlalchemy.orm import Session

from server.models import Study, StudyVersion
from server.participation.tally_pools import pooled_tally
from server.results.repository import Pool
from server.results.schemas import AnyResults, OtherResults
from server.results.service import common_results
from server.studies.lookup import definition_of

Summarise = Callable[[Session, Study, StudyVersion, Pool], AnyResults]
"""The results of a pool of answers, which is of the data series of this version."""


def summary_of(kind: str) -> Summarise:
    """How the answers to trials of this kind are summed up."""
    module = f"server.results.kinds.{kind}"
    try:
        summarise: Summarise = import_module(module).summarise
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return _summarise_unknown
    return summarise


def _summarise_unknown(session: Session, study: Study, version: StudyVersion, of: Pool) -> OtherResults:
    """Of a kind without a file here: how much there is, how it was shown, and that this is all."""
    kind = definition_of(version).trial.kind
    tally = pooled_tally(session, of.runs(), "", ())
    return OtherResults(
        **common_results(study, version, of, tally),
        ratings=tally.answers.total(),
        note=f"Answers of {kind.replace('_', ' ')} trials have no summary here; the Data page exports them.",
    )
