"""How much one run may hold beside its ratings: our page stays far below, a script fills no disk."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from server.errors import ApiError
from server.evidence.repository import ANSWER, VIEW
from server.trials.refused_records import REFUSED

DEVICE_KEYS, DEVICE_BYTES = 200, 32 * 1024
EVENT_BYTES, EVENTS_A_RUN = 4 * 1024, 20_000
"""A heartbeat every few seconds makes some hundred events an hour."""
CALIBRATIONS_A_RUN = 100
SERVER_EVENTS = frozenset({"screened_out", "warned", REFUSED, *ANSWER, *VIEW})
"""Types of events that say what the server did: codes and evidence rest on them, so no page may send them."""
MAX_DEPTH = 8


class RunDataTooLarge(ApiError):
    """A run holds as much as it may."""

    status = 413
    code = "run_data_too_large"


def checked_device(device: dict[str, Any]) -> dict[str, Any]:
    """`device` as it is to be stored; RunDataTooLarge where it is more than a browser has to say."""
    if len(device) > DEVICE_KEYS:
        raise RunDataTooLarge(f"Expected at most {DEVICE_KEYS} facts of the device, got {len(device)}.")
    _check_size(device, DEVICE_BYTES, "the facts of the device")
    return device


def checked_data(data: dict[str, Any]) -> dict[str, Any]:
    """The data of one event; RunDataTooLarge where they are more than an event has to say."""
    _check_size(data, EVENT_BYTES, "the data of an event")
    return data


class EventReserved(ApiError):
    """A page sent an event that only the server writes."""

    status = 422
    code = "event_reserved"


def check_event_types(types: Iterable[str]) -> None:
    """EventReserved where one of the types is the server's own."""
    reserved = sorted(SERVER_EVENTS.intersection(types))
    if reserved:
        raise EventReserved(f"Events of type '{reserved[0]}' are the server's own; nothing is stored.")


def check_events(data: Sequence[dict[str, Any]], stored: int) -> None:
    """RunDataTooLarge where an event, or the number of a run's events, is too large."""
    if stored + len(data) > EVENTS_A_RUN:
        raise RunDataTooLarge(f"This visit has {stored} events; {EVENTS_A_RUN} are the most.")
    for one in data:
        checked_data(one)


def check_calibrations(stored: int) -> None:
    """RunDataTooLarge where a run has as many calibrations as it may."""
    if stored >= CALIBRATIONS_A_RUN:
        raise RunDataTooLarge(f"This visit has {stored} calibrations; no more are taken.")


def _check_size(value: Mapping[str, Any], limit: int, what: str) -> None:
    if _depth(value) > MAX_DEPTH:
        raise RunDataTooLarge(f"Expected {what} at most {MAX_DEPTH} levels deep.")
    size = len(json.dumps(value))
    if size > limit:
        raise RunDataTooLarge(f"Expected {what} within {limit >> 10} KiB, got {size >> 10} KiB.")


def _depth(value: Any) -> int:
    """Levels of nesting, counted up to one more than is allowed."""
    level, depth = [value], 0
    while level and depth <= MAX_DEPTH:
        inner = [one for one in level if isinstance(one, dict | list)]
        level = [part for one in inner for part in (one.values() if isinstance(one, dict) else one)]
        depth += bool(inner)
    return depth
