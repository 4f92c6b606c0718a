"""The tidy CSV: the rows of the view of the study's kind of trial, run after run, in constant memory."""

from collections.abc import Iterator, Sequence
from typing import Any

from sqlalchemy.orm import Session

from experiments.columns import View
from experiments.trials import KINDS
from server.export import repository
from server.export.extract import Extract
from server.models import Study
from server.studies.lookup import active_definition, all_definitions


def view_of(session: Session, study: Study) -> View:
    """The view that holds the answers of the study's kind of trial, as its version in use declares it."""
    return KINDS[active_definition(session, study).trial.kind].view


def factor_names(session: Session, study: Study) -> tuple[str, ...]:
    """Factors of all versions of a study, in declared order."""
    definitions = all_definitions(session, study)
    return tuple(dict.fromkeys(factor.name for one in definitions for factor in one.factors))


def rating_count(session: Session, study: Study, extract: Extract) -> int:
    """Rows that `rating_rows` gives."""
    trials = [one.trial for one in all_definitions(session, study)]
    if any(len(trial.rated_scales()) > 1 for trial in trials):
        # A rating is a row a scale.
        return repository.rows_in_view(session, study, extract, view_of(session, study))
    kind = active_definition(session, study).trial.kind
    of_one_kind = all(trial.kind == kind for trial in trials)
    return repository.play_count(session, study, extract, None if of_one_kind else kind)


def rating_rows(session: Session, study: Study, extract: Extract) -> Iterator[Sequence[Any]]:
    """Rows of the study's view; see `repository.view_rows`."""
    return repository.view_rows(session, study, extract, view_of(session, study))
