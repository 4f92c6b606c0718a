"""Eyes shut for longer than the classifier's dips last: told by the level of the same eye's blinks."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stimuli_builder.blinks.events.lid_event import LidEvent
from stimuli_builder.blinks.gaps import runs
from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array
from stimuli_builder.blinks.series import box_filter

LONG_S = 2.0
SHUT_SHARE = 0.2
"""Part of the way from the blinks' closed level to the recording's opening below which a lid is shut."""
SMOOTHING_S = 0.1
TOLD_SHARE = 0.8
"""A closed eye that lasts for less than this part of the time its lids are shut ends too early."""
EDGE_S = 0.5
"""A lid closes and opens again within this time."""


def with_long_closures(distance: Array, fps: float, events: Sequence[LidEvent]) -> list[LidEvent]:
    """The events in order of time, with closed eyes of two seconds or longer of which none tells.

    Their probability is 1: they are told by a rule. An eye that does not open again before a gap or the end
    is told too, with that as its end. Blinks within are of lids that tremble, and are left out. Where the eye
    has no blink nothing tells its closed level, and nothing is added.

    Parameters
    ----------
    distance : (n,) float64 array
        Of the whole series, NaN in gaps.
    events : sequence of LidEvent
        What the classifier tells of it.
    """
    minima = [distance[event.frame] for event in events if event.kind == "blink"]
    if not minima:
        return list(events)
    closed, opening = float(np.median(minima)), float(np.nanpercentile(distance, OPEN_PERCENTILE))
    level = box_filter(np.where(np.isfinite(distance), distance, np.inf), max(1.0, SMOOTHING_S * fps))
    shut = runs(level < closed + SHUT_SHARE * (opening - closed))
    longer = [
        _event(distance, fps, start, stop, closed, opening)
        for start, stop in shut
        if (stop - start) >= LONG_S * fps
        and not any(_tells(event, start / fps, stop / fps) for event in events)
    ]
    for shut_eye in longer:
        events = [event for event in events if not _holds(shut_eye, event)]
    parted = [_beside(shut_eye, events) for shut_eye in longer]
    return sorted([*events, *parted], key=lambda event: event.minimum_s)


def _tells(event: LidEvent, start_s: float, stop_s: float) -> bool:
    """Whether an event tells of the shut lids from `start_s` to `stop_s`: one of another kind, or as long."""
    overlaps = event.onset_s < stop_s and start_s < event.end_s
    long_enough = event.closed_to_s - event.closed_from_s >= TOLD_SHARE * (stop_s - start_s)
    return overlaps and event.kind != "blink" and (event.kind != "closed_eye" or long_enough)


def _holds(shut_eye: LidEvent, event: LidEvent) -> bool:
    return shut_eye.closed_from_s <= event.minimum_s <= shut_eye.closed_to_s


def _beside(shut_eye: LidEvent, events: Sequence[LidEvent]) -> LidEvent:
    """The closed eye from the end of the blink before it to the beginning of the one after it."""
    before = [event.end_s for event in events if event.minimum_s < shut_eye.closed_from_s]
    after = [event.onset_s for event in events if event.minimum_s > shut_eye.closed_to_s]
    onset = min(max(shut_eye.onset_s, *before, 0.0), shut_eye.closed_from_s)
    return replace(shut_eye, onset_s=onset, end_s=max(shut_eye.closed_to_s, min([shut_eye.end_s, *after])))


def _event(distance: Array, fps: float, start: int, stop: int, closed: float, opening: float) -> LidEvent:
    """The closed eye whose closed phase runs from frame `start` to before `stop`."""
    opened = distance > opening - 0.05 * (opening - closed)
    reach = round(EDGE_S * fps)
    before = np.flatnonzero(opened[max(0, start - reach) : start])
    after = np.flatnonzero(opened[stop : stop + reach])
    onset = start if not before.size else max(0, start - reach) + int(before[-1])
    end = stop - 1 if not after.size else stop + int(after[0])
    deepest = start + int(np.nanargmin(distance[start:stop]))
    return LidEvent(
        kind="closed_eye",
        probability=1.0,
        frame=deepest,
        onset_s=onset / fps,
        closed_from_s=start / fps,
        minimum_s=deepest / fps,
        closed_to_s=(stop - 1) / fps,
        end_s=end / fps,
        depth=float(1 - distance[deepest] / opening),
    )
