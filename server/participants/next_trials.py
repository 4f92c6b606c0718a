"""What an answer changes of the trials to come, told with its receipt."""

import logging

from server.context import Services
from server.participants.lookup import find_run
from server.participants.trial_list import trial_list
from server.trials.schemas import NextTrials, Receipt
from server.trials.series import service as series
from server.trials.series.service import Outlook

log = logging.getLogger("palpebra")


def next_trials(services: Services, token: str, receipt: Receipt) -> tuple[Receipt, NextTrials | None]:
    """The receipt with what remains once ended series are closed, and the trials chosen anew."""
    outlook = follow(services, token)
    if outlook is None:
        return receipt, None
    offered = {offer.trial_index for offer in outlook.offers}
    with services.database.read() as session:
        run = find_run(session, token)
        every = trial_list(session, run, services.versions.get(session, run.version_id))
    trials = [trial for trial in every if trial.trial_index in offered]
    receipt = receipt.model_copy(update={"remaining": outlook.remaining})
    return receipt, NextTrials(trials=trials, closed=list(outlook.closed))


def follow(services: Services, token: str) -> Outlook | None:
    """Bring a run's series up to its answers. What fails here is logged and done again with the next answer.

    The answer itself is stored by then, and its receipt must not be lost to a choice that could not be made.
    """
    try:
        return series.follow(services.database, services.versions, token)
    except Exception:
        log.exception("the series of a run could not be followed; its page goes on with what it has")
        return None
