"""Attention checks: how many of a run have failed, and whether so many end it."""

from sqlalchemy import Connection

from experiments.definition import Experiment
from experiments.rules import ScreenAttention
from experiments.trials import KINDS
from server.clock import now
from server.tokens import new_public_id
from server.trials import repository

EVENT = "screened_out"


def failed_checks(connection: Connection, run_id: int, experiment: Experiment) -> int:
    """Attention checks of a run answered otherwise than asked, and those whose answer could not be stored."""
    given = KINDS[experiment.trial.kind].check_response
    wrong = sum(given(payload) != expected for payload, expected in repository.checks(connection, run_id))
    # Else a script would pass every check by answers that are refused.
    return wrong + repository.refused_checks(connection, run_id)


def by_attention(connection: Connection, run_id: int, experiment: Experiment) -> bool:
    """End the run where too many attention checks have failed; True where it did."""
    limits = [rule.more_than for rule in experiment.screening if isinstance(rule, ScreenAttention)]
    failed = failed_checks(connection, run_id, experiment) if limits else 0
    if not limits or failed <= min(limits):
        return False
    repository.end_run(connection, run_id, "screened_out")
    data = {"rule": "attention_checks_failed", "failed": failed}
    repository.add_event(connection, run_id, new_public_id(), EVENT, data, now())
    return True
