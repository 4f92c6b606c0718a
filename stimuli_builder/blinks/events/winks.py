"""Winks: an eye shuts while the other stays open, among blinks of both.

Looked at together the other eye speaks against such a blink, as the networks learned from faces whose eyes do
the same. Where one eye shuts wholly and the other does not move, its own look is taken.
"""

from collections.abc import Sequence

from stimuli_builder.blinks.events.apart import SHUT
from stimuli_builder.blinks.events.lid_event import LidEvent
from stimuli_builder.blinks.profile import Array

SURE = 0.9
"""Probability of a blink, by a look at its eye alone, from which a wink is told."""
SHUT_SHARE = 0.8
"""Part of the depth of an eye's own blinks to which a wink goes at least."""
OPEN_SHARE = 0.2
"""Part of the depth of the other eye's blinks below which that eye stays."""


def with_winks(
    told: Sequence[LidEvent], alone: Sequence[LidEvent], own: Array, other: Array, fps: float
) -> tuple[list[LidEvent], list[float]]:
    """The events of one eye with the winks that its look alone tells of, and when its winks are deepest.

    Parameters
    ----------
    told, alone : sequence of LidEvent
        Of the eye, by a look at both eyes together, and at it alone.
    own, other : (n,) float64 array
        Smoothed depth of either eye, as part of that of its blinks; NaN where it is not seen.
    fps : float

    Returns
    -------
    events : list of LidEvent
        In order of time; what was no blink at the moment of a wink is left out.
    winks_s : list of float
        Deepest moments of all blinks of this eye alone, in seconds.
    """
    shut = [event for event in told if event.kind in SHUT]
    missed = [
        event
        for event in alone
        if event.probability >= SURE
        and _is_wink(event, own, other, fps)
        and not any(one.onset_s < event.end_s and event.onset_s < one.end_s for one in shut)
    ]
    kept = [
        event
        for event in told
        if event.kind in SHUT or not any(one.onset_s <= event.minimum_s <= one.end_s for one in missed)
    ]
    events = sorted([*kept, *missed], key=lambda event: event.minimum_s)
    return events, [event.minimum_s for event in events if _is_wink(event, own, other, fps)]


def _is_wink(event: LidEvent, own: Array, other: Array, fps: float) -> bool:
    """Whether an event is a blink that shuts the eye while the other is seen to be open."""
    first, last = (round(time * fps) for time in (event.closed_from_s, event.closed_to_s))
    beside = other[max(0, first) : last + 1]
    return bool(
        event.kind == "blink"
        and own[event.frame] >= SHUT_SHARE
        and beside.size
        and (beside < OPEN_SHARE).all()
    )
