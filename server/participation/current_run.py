"""The run a token stands for, how much it may hold, and whether a rule screens it out."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, assert_never

from sqlalchemy.orm import Session

from experiments.declaration.experiment import Experiment
from experiments.rules import ScreenAttention, ScreenDevice, ScreenFormAnswer
from server.core.errors import ApiError
from server.core.values import new_public_id, now
from server.models import RunEvent, StudyRun
from server.participation import run_repository
from server.participation.evidence_repository import ANSWER, VIEW
from server.participation.rating_repository import REFUSED
from server.participation.refusals import RunClosed, RunUnknown
from server.participation.warnings import EVENT

# The run a token stands for.


def find_run(session: Session, token: str, *, lock: bool = False) -> StudyRun:
    """The run with this token, or RunUnknown."""
    run = run_repository.run_by_token(session, token, lock=lock)
    if run is None:
        raise RunUnknown(
            "This visit is unknown. Please open your link again.",
            headers={"www-authenticate": "Bearer"},
        )
    return run


def open_run(session: Session, token: str) -> StudyRun:
    """The run with this token, marked as seen; RunClosed where it is over."""
    run = find_run(session, token, lock=True)
    # Under the lock: a run that ends at this moment takes nothing more.
    if run.status != "active":
        raise RunClosed(f"This visit is over ({run.status.replace('_', ' ')}); nothing more is stored.")
    run.last_seen_at = now()
    return run


# How much one run may hold in addition to its ratings: our page stays far below, a script fills no disk.

DEVICE_KEYS, DEVICE_BYTES = 200, 32 * 1024
EVENT_BYTES, EVENTS_A_RUN = 4 * 1024, 20_000
"""A heartbeat every few seconds makes some hundred events an hour."""
CALIBRATIONS_A_RUN = 100
SERVER_EVENTS = frozenset({"screened_out", "warned", REFUSED, *ANSWER, *VIEW})
"""Types of events that say what the server did: codes and evidence rest on them, so no page may send them."""
MAX_DEPTH = 8


class RunDataTooLarge(ApiError, status=413, code="run_data_too_large"):
    """A run holds as much as it may."""


def checked_device(device: dict[str, Any]) -> dict[str, Any]:
    """`device` as it is to be stored; RunDataTooLarge where it is more than a browser has to say."""
    if len(device) > DEVICE_KEYS:
        raise RunDataTooLarge(f"Expected at most {DEVICE_KEYS} device properties, got {len(device)}.")
    _check_size(device, DEVICE_BYTES, "the device properties")
    return device


def checked_data(data: dict[str, Any]) -> dict[str, Any]:
    """The data of one event; RunDataTooLarge where they are more than an event has to say."""
    _check_size(data, EVENT_BYTES, "the data of an event")
    return data


class EventReserved(ApiError, status=422, code="event_reserved"):
    """A page sent an event that only the server writes."""


def check_event_types(types: Iterable[str]) -> None:
    """EventReserved where one of the types is the server's own."""
    reserved = sorted(SERVER_EVENTS.intersection(types))
    if reserved:
        raise EventReserved(f"Events of type '{reserved[0]}' are reserved for the server; nothing is stored.")


def check_events(data: Sequence[dict[str, Any]], stored: int) -> None:
    """RunDataTooLarge where an event, or the number of a run's events, is too large."""
    if stored + len(data) > EVENTS_A_RUN:
        raise RunDataTooLarge(
            f"Expected at most {EVENTS_A_RUN} events of a visit, got {stored + len(data)}; nothing is stored."
        )
    for one in data:
        checked_data(one)


def check_calibrations(stored: int) -> None:
    """RunDataTooLarge where a run has as many calibrations as it may."""
    if stored >= CALIBRATIONS_A_RUN:
        raise RunDataTooLarge(
            f"Expected at most {CALIBRATIONS_A_RUN} calibrations of a visit, got {stored + 1}."
        )


def _check_size(value: Mapping[str, Any], limit: int, what: str) -> None:
    # Before the size: a text of brackets may be small and still exhaust the stack of its reader.
    if _depth(value) > MAX_DEPTH:
        raise RunDataTooLarge(f"Expected {what} at most {MAX_DEPTH} levels deep.")
    size = len(json.dumps(value))
    if size > limit:
        raise RunDataTooLarge(f"Expected {what} within {limit >> 10} KiB, got {size >> 10} KiB.")


def _depth(value: Any) -> int:
    """Levels of nesting, counted up to one more than is allowed."""
    level, depth = [value], 0
    # Level by level and not by recursion, for the same reason.
    while level and depth <= MAX_DEPTH:
        inner = [one for one in level if isinstance(one, dict | list)]
        level = [part for one in inner for part in (one.values() if isinstance(one, dict) else one)]
        depth += bool(inner)
    return depth


# Screening: a run ends as screened out where a declared rule says so. Its slot is then free again.


class _ScreeningRules(NamedTuple):
    """The rules of an experiment by the moment at which they are looked at."""

    answers: list[ScreenFormAnswer]
    devices: list[ScreenDevice]


def _screening_rules(experiment: Experiment) -> _ScreeningRules:
    declared = _ScreeningRules([], [])
    for rule in experiment.screening:
        match rule:
            case ScreenFormAnswer():
                declared.answers.append(rule)
            case ScreenAttention():
                pass  # looked at with each check that is answered, by server.participation.warnings
            case ScreenDevice():
                declared.devices.append(rule)
            case _:
                assert_never(rule)
    return declared


def screens_devices(experiment: Experiment) -> bool:
    """True where a browser or screen that will not do ends the run."""
    return bool(_screening_rules(experiment).devices)


def by_form(
    session: Session, run: StudyRun, experiment: Experiment, form: str, answers: Mapping[str, Any]
) -> None:
    """End the run where a rule refuses one of these (checked) answers."""
    for rule in _screening_rules(experiment).answers:
        if rule.form == form and rule.field in answers and rule.screens_out(answers[rule.field]):
            return _end(session, run, {"rule": rule.rule, "form": form, "field": rule.field})
    return None


def by_device(session: Session, run: StudyRun, reason: str, data: Mapping[str, Any]) -> None:
    """End the run of a browser or screen that cannot show the clips as declared."""
    _end(session, run, checked_data({**data, "rule": "device", "reason": reason}))


def by_full_group(session: Session, run: StudyRun, group: str) -> None:
    """End the run where every place of its group is taken."""
    _end(session, run, {"rule": "group_full", "group": group})


def _end(session: Session, run: StudyRun, data: dict[str, Any]) -> None:
    run.status = "screened_out"
    session.add(RunEvent(event_id=new_public_id(), study_run_id=run.id, type=EVENT, data=data))
