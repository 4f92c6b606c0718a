"""Events of one eye that overlap: one motion told twice, or two that touch."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from stimuli_builder.blinks.events.generated import CLOSED_EYE_S
from stimuli_builder.blinks.events.lid_event import LidEvent
from stimuli_builder.blinks.profile import Array

SHUT = frozenset({"blink", "closed_eye"})
LOWERED = frozenset({"squint", "gaze_shift"})
"""A lid may blink or stay shut while it is lowered; else an eye does one thing at a time."""


def apart(events: Sequence[LidEvent], depth: Array, start: int, fps: float) -> list[LidEvent]:
    """Events of one piece in order of time, of which those that shut do not overlap, nor those that lower.

    Of two events that are no blinks, where the deepest moment of one lies in the other, the longer stays: a
    lid that trembles while it is held is one event. Others that overlap, a blink beside a closed eye too,
    part where the eye is open widest between them. A closed eye of whose closed phase less is left than one
    lasts is no event, and leaves its neighbours as they were.

    Parameters
    ----------
    depth : (n,) array
        Smoothed depth of the piece, which begins at frame `start` of the series.
    """
    kept: list[LidEvent] = []
    for kinds in (SHUT, LOWERED):
        told = _once(sorted((event for event in events if event.kind in kinds), key=_length, reverse=True))
        kept += _parted(sorted(told, key=lambda event: event.minimum_s), depth, start, fps)
    return sorted(kept, key=lambda event: event.minimum_s)


def _length(event: LidEvent) -> float:
    return event.end_s - event.onset_s


def _once(longest_first: Sequence[LidEvent]) -> list[LidEvent]:
    """The events without those that a longer one holds, or that hold its deepest moment."""
    kept: list[LidEvent] = []
    for event in longest_first:
        if all("blink" in (event.kind, other.kind) or not _nested(event, other) for other in kept):
            kept.append(event)
    return kept


def _nested(one: LidEvent, other: LidEvent) -> bool:
    """Whether the deepest moment of either lies in the other."""
    return one.onset_s <= other.minimum_s <= one.end_s or other.onset_s <= one.minimum_s <= other.end_s


def _parted(events: Sequence[LidEvent], depth: Array, start: int, fps: float) -> list[LidEvent]:
    """Events in order of time, neighbours that overlap parted at the widest opening between them."""
    parted = list(events)
    for number, (first, second) in enumerate(pairwise(events)):
        if first.end_s <= second.onset_s:
            continue
        low, high = sorted((first.frame - start, second.frame - start))
        widest = (low + int(np.argmin(depth[low : high + 1])) + start) / fps
        at = float(np.clip(widest, first.minimum_s, second.minimum_s))
        parted[number] = _within(parted[number], parted[number].onset_s, at)
        parted[number + 1] = _within(second, at, second.end_s)
    whole = [event for event, part in zip(events, parted, strict=True) if event == part or _lasts(part)]
    return parted if len(whole) == len(events) else _parted(whole, depth, start, fps)


def _lasts(part: LidEvent) -> bool:
    """Whether what is left of an event is still one of its kind."""
    return part.kind != "closed_eye" or part.closed_to_s - part.closed_from_s >= CLOSED_EYE_S


def _within(event: LidEvent, onset_s: float, end_s: float) -> LidEvent:
    """The event cut to a time that holds its deepest moment."""
    closed_from_s, closed_to_s = np.clip([event.closed_from_s, event.closed_to_s], onset_s, end_s).tolist()
    return replace(event, onset_s=onset_s, closed_from_s=closed_from_s, closed_to_s=closed_to_s, end_s=end_s)
