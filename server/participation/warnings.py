"""Attention checks and warnings: careless answers get a warning, and a run that goes on like this ends."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import Connection

from experiments.declaration.base import Translated
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from experiments.rules import ScreenAttention, WarningRule
from experiments.rules.warnings import GivenAnswer
from server.core.values import new_public_id, now
from server.participation import rating_repository
from server.participation.answer_schemas import WarningShown
from server.participation.evidence import comparable_answer

# Attention checks: how many of a run have failed, and whether that ends the run.

EVENT = "screened_out"


def failed_checks(connection: Connection, run_id: int, experiment: Experiment) -> int:
    """Attention checks of a run answered otherwise than asked, and those whose answer could not be stored."""
    given = KINDS[experiment.trial.kind].check_response
    wrong = sum(
        given(payload) != expected for payload, expected in rating_repository.checks(connection, run_id)
    )
    # Else a script would pass every check by answers that are refused.
    return wrong + rating_repository.refused_checks(connection, run_id)


def by_attention(connection: Connection, run_id: int, experiment: Experiment) -> bool:
    """End the run where too many attention checks have failed; True where it did."""
    limits = [rule.more_than for rule in experiment.screening if isinstance(rule, ScreenAttention)]
    failed = failed_checks(connection, run_id, experiment) if limits else 0
    if not limits or failed <= min(limits):
        return False
    rating_repository.end_run(connection, run_id, "screened_out")
    data = {"rule": "attention_checks_failed", "failed": failed}
    rating_repository.add_event(connection, run_id, new_public_id(), EVENT, data, now())
    return True


# Warnings: careless answers get a friendly warning, and a run that goes on like this ends.
#
# A lapse counts for the next warning only by answers that came after the page had shown the last one, so that
# nobody whose answers are delivered late, and all at once, is ended without having read a word.

WARNED = "warned"
"""The event of a run whose participant is warned."""
SHOWN = "warning_shown"
"""The event that the page sends when the participant has read it."""
RULE = "warnings"
"""Names in the event of a run's end that it went on after its last warning."""


class Lapse(NamedTuple):
    """What an answer leads to: a warning, or the end of the run."""

    warning: WarningShown | None
    ends: bool


NO_LAPSE = Lapse(None, ends=False)


# Decision 0605: A warning counts once it was read.
def after_answer(
    connection: Connection, run: int, experiment: Experiment, rating_id: str, saved_at: datetime
) -> Lapse:
    """Judge the run's latest answers to main trials, this one among them; warn, or end the run."""
    rules = experiment.warnings.rules
    if not rules:
        return NO_LAPSE
    rows = rating_repository.latest_answers(connection, run, max(rule.answers for rule in rules))
    # Without events at first: nearly every answer ends here, and costs one query.
    if _broken_rule(rules, rows) is None:
        return NO_LAPSE
    events = rating_repository.events_of(connection, run, (WARNED, SHOWN))
    warned = sum(event.type == WARNED for event in events)
    shown = [event.received_at for event in events if event.type == SHOWN]
    rule = _broken_rule(rules, [row for row in rows if not shown or row.saved_at > max(shown)])
    # One warning at a time: while the last is unread, no other is given, and nobody is ended.
    if rule is None or len(shown) < warned:
        return NO_LAPSE
    if warned < experiment.warnings.maximum:
        return _warn(connection, run, experiment, rule, warned + 1, rating_id, saved_at)
    if experiment.warnings.then == "go_on":
        return NO_LAPSE
    rating_repository.end_run(connection, run, "screened_out")
    data = {"rule": RULE, "lapse": rule.rule}
    rating_repository.add_event(connection, run, new_public_id(), EVENT, data, saved_at)
    return Lapse(None, ends=True)


def waiting_warning(connection: Connection, run: int, experiment: Experiment) -> WarningShown | None:
    """The last warning of a run that no page has shown yet: the one that got it may be gone."""
    if not experiment.warnings.rules:
        return None
    events = rating_repository.events_of(connection, run, (WARNED, SHOWN))
    warned = [event.data for event in events if event.type == WARNED]
    # The other events are warnings that were shown: as many as were given means that none waits.
    if len(warned) <= len(events) - len(warned):
        return None
    return _as_told(connection, run, experiment, warned[-1])


def warning_of(
    connection: Connection, run: int, experiment: Experiment, rating_id: str
) -> WarningShown | None:
    """The warning that a stored answer led to; a page that did not get the receipt asks for it again."""
    if not experiment.warnings.rules:
        return None
    data = rating_repository.event_data(connection, run, _event_id(rating_id))
    return _as_told(connection, run, experiment, data) if data else None


def _as_told(
    connection: Connection, run: int, experiment: Experiment, data: dict[str, Any]
) -> WarningShown | None:
    rules = (rule for rule in experiment.warnings.rules if rule.rule == data["rule"])
    rule = next(rules, None)
    return _shown_warning(connection, run, experiment, rule, data["number"]) if rule else None


def _broken_rule(rules: Sequence[WarningRule], rows: Sequence[Any]) -> WarningRule | None:
    """The first rule that the latest of these answers (the latest first) break."""
    values = [(comparable_answer(row.payload), row.rt) for row in rows]
    # Back in the order of answering, in which patterns are looked for.
    given = [GivenAnswer(str(value), rt) for value, rt in values if value is not None][::-1]
    for rule in rules:
        if len(given) >= rule.answers and rule.lapses(given[-rule.answers :]):
            return rule
    return None


def _warn(
    connection: Connection,
    run: int,
    experiment: Experiment,
    rule: WarningRule,
    number: int,
    rating_id: str,
    saved_at: datetime,
) -> Lapse:
    data = {"rule": rule.rule, "number": number}
    rating_repository.add_event(connection, run, _event_id(rating_id), WARNED, data, saved_at)
    return Lapse(_shown_warning(connection, run, experiment, rule, number), ends=False)


def _shown_warning(
    connection: Connection, run: int, experiment: Experiment, rule: WarningRule, number: int
) -> WarningShown:
    text = in_language(rule.text, rating_repository.language(connection, run), experiment.languages)
    return WarningShown(rule=rule.rule, number=number, maximum=experiment.warnings.maximum, text=text)


def in_language(text: Translated, language: str, languages: Sequence[str]) -> str:
    """A declared text in this language, else in the study's first, in English, or in any that there is."""
    return next((text[tag] for tag in (language, languages[0], "en", *text) if text.get(tag)), "")


def _event_id(rating_id: str) -> str:
    # From the rating's id: the same answer sent again warns once, and finds its own warning.
    return f"{WARNED} {rating_id.replace('-', '')}"
