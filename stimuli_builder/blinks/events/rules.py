"""An event of one eye, and rules over several: overlaps, winks, an eye that moves less, long closures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stimuli_builder.blinks.events.candidates import CLASSES, CLOSED_EYE_S, Candidate
from stimuli_builder.blinks.events.network import Piece
from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array
from stimuli_builder.blinks.series import box_filter
from stimuli_builder.blinks.times import runs

# One event of one eye.


@dataclass(frozen=True)
class PhaseFit:
    """What the fit of a blink's phases says of its levels, and how sure it is of the phases.

    Parameters
    ----------
    open_before, open_after : float
        Distance at which the lid rests before and after the blink, in the unit of the series.
    fallen : float
        Distance by which the lid falls below the line from `open_before` to `open_after`.
    down_error_s, up_error_s, duration_error_s : float
        Standard errors of closing, opening and the whole.
    """

    open_before: float
    open_after: float
    fallen: float
    down_error_s: float
    up_error_s: float
    duration_error_s: float


# Decision 0911: A likely squint is not a blink.
@dataclass(frozen=True)
class LidEvent:
    """One event of one eye.

    Parameters
    ----------
    kind : str
        "blink", "squint", "gaze_shift" or "closed_eye" (closed phase of 0.5 s or more).
    probability : float
        The classifier's, of this kind among the four and 'nothing'; 1 if from `with_long_closures`.
    frame : int
        Deepest frame of the series.
    onset_s, closed_from_s, minimum_s, closed_to_s, end_s : float
        From 5% of the amplitude over the closed phase (95% of it) to 95% recovery, from the first frame.
    depth : float
        Greatest depth as part of the opening.
    fit : PhaseFit, optional
        What the fit of a blink's phases says besides; None where no curve was fitted.
    is_moved : bool
        Whether a person's review set its onset and end.
    """

    kind: str
    probability: float
    frame: int
    onset_s: float
    closed_from_s: float
    minimum_s: float
    closed_to_s: float
    end_s: float
    depth: float
    fit: PhaseFit | None = None
    is_moved: bool = False


# Eyes closed for longer than the classifier's dips last: detected by the level of the same eye's blinks.

LONG_S = 2.0
SHUT_SHARE = 0.2
"""Part of the way from the blinks' closed level to the recording's opening below which a lid is shut."""
SMOOTHING_S = 0.1
TOLD_SHARE = 0.8
"""A closed eye that lasts for less than this part of the time its lids are shut ends too early."""
EDGE_S = 0.5
"""A lid closes and opens again within this time."""


def with_long_closures(distance: Array, fps: float, events: Sequence[LidEvent]) -> list[LidEvent]:
    """The events in order of time, with closed eyes of two seconds or longer that none of them covers.

    Their probability is 1: a rule detects them. An eye that does not open again before a gap or the end is
    included, with that as its end. Blinks within are trembling lids, and are removed. If the eye has no
    blink, its closed level is unknown, and nothing is added.

    Parameters
    ----------
    distance : (n,) float64 array
        Of the whole series, NaN in gaps.
    events : sequence of LidEvent
        The classifier's events of it.
    """
    minima = [distance[event.frame] for event in events if event.kind == "blink"]
    if not minima:
        return list(events)
    # By this eye's own blinks: an aspect ratio of shut lids is not 0, and differs between people.
    closed, opening = float(np.median(minima)), float(np.nanpercentile(distance, OPEN_PERCENTILE))
    # Infinity spreads through the average: next to a gap nothing counts as shut.
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
    parted = [_closed_eye_between(shut_eye, events) for shut_eye in longer]
    return sorted([*events, *parted], key=lambda event: event.minimum_s)


def _tells(event: LidEvent, start_s: float, stop_s: float) -> bool:
    """Whether an event covers the closed lids from `start_s` to `stop_s`: one of another kind, or as long."""
    overlaps = event.onset_s < stop_s and start_s < event.end_s
    long_enough = event.closed_to_s - event.closed_from_s >= TOLD_SHARE * (stop_s - start_s)
    return overlaps and event.kind != "blink" and (event.kind != "closed_eye" or long_enough)


def _holds(shut_eye: LidEvent, event: LidEvent) -> bool:
    return shut_eye.closed_from_s <= event.minimum_s <= shut_eye.closed_to_s


def _closed_eye_between(shut_eye: LidEvent, events: Sequence[LidEvent]) -> LidEvent:
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


# Events of one eye that overlap: one motion detected twice, or two that touch.

SHUT = frozenset({"blink", "closed_eye"})
LOWERED = frozenset({"squint", "gaze_shift"})
"""A lid may blink or stay shut while it is lowered; else an eye does one thing at a time."""


def separate_events(events: Sequence[LidEvent], depth: Array, start: int, fps: float) -> list[LidEvent]:
    """Events of one piece in order of time, of which those that shut do not overlap, nor those that lower.

    Of two events that are not blinks, if the deepest moment of one is in the other, the longer stays: a lid
    that trembles while it is held is one event. Other overlapping events, also a blink next to a closed eye,
    are split where the eye is widest open between them. A closed eye whose remaining closed phase is too
    short is not an event, and leaves its neighbors as they were.

    Parameters
    ----------
    depth : (n,) array
        Smoothed depth of the piece, which begins at frame `start` of the series.
    """
    kept: list[LidEvent] = []
    for kinds in (SHUT, LOWERED):
        # The longest first: what it holds is a trembling of it, never the other way round.
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
    """Events in order of time, neighbors that overlap parted at the widest opening between them."""
    parted = list(events)
    for number, (first, second) in enumerate(pairwise(events)):
        if first.end_s <= second.onset_s:
            continue
        low, high = sorted((first.frame - start, second.frame - start))
        widest = (low + int(np.argmin(depth[low : high + 1])) + start) / fps
        at = float(np.clip(widest, first.minimum_s, second.minimum_s))
        parted[number] = _cut_to_times(parted[number], parted[number].onset_s, at)
        parted[number + 1] = _cut_to_times(second, at, second.end_s)
    whole = [event for event, part in zip(events, parted, strict=True) if event == part or _lasts(part)]
    return parted if len(whole) == len(events) else _parted(whole, depth, start, fps)


def _lasts(part: LidEvent) -> bool:
    """Whether what is left of an event is still one of its kind."""
    return part.kind != "closed_eye" or part.closed_to_s - part.closed_from_s >= CLOSED_EYE_S


def _cut_to_times(event: LidEvent, onset_s: float, end_s: float) -> LidEvent:
    """The event cut to a time that holds its deepest moment."""
    closed_from_s, closed_to_s = np.clip([event.closed_from_s, event.closed_to_s], onset_s, end_s).tolist()
    return replace(event, onset_s=onset_s, closed_from_s=closed_from_s, closed_to_s=closed_to_s, end_s=end_s)


# Winks: an eye shuts while the other stays open, among blinks of both.
#
# Looked at together the other eye speaks against such a blink, as the networks learned from faces whose
# eyes do the same. Where one eye shuts wholly and the other does not move, its own look is taken.

SURE = 0.9
"""Probability of a blink, from its eye alone, above which it is a wink."""
WINK_SHUT_SHARE = 0.8
"""Part of the depth of an eye's own blinks to which a wink goes at least."""
OPEN_SHARE = 0.2
"""Part of the depth of the other eye's blinks below which that eye stays."""


def with_winks(
    told: Sequence[LidEvent], alone: Sequence[LidEvent], own: Array, other: Array, fps: float
) -> tuple[list[LidEvent], list[float]]:
    """The events of one eye with the winks detected from it alone, and when its winks are deepest.

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
        and own[event.frame] >= WINK_SHUT_SHARE
        and beside.size
        and (beside < OPEN_SHARE).all()
    )


# How far one eye goes along with the blinks of the other: a palsied eye says nothing of the other's blinks.
#
# The networks learned from faces whose eyes do the same. Where one eye moves much less than the other, or not
# at all, what it does not do would be taken for a sign that the other did not blink.

LIKELY = 0.5
"""Probability from which a dip of an eye by itself is one of the blinks that the other is compared at."""
MUCH_LESS = 0.5
"""Below this part of the other's movement an eye is not evidence about the other's blinks."""
LEAST_MOVEMENT = 0.05
"""Below this part of the other's movement an eye does not move, whatever its noise."""
NOISES = 2.0
"""Standard errors by which a movement rises above what the eye does at other times."""
FLANK_S, CORE_S = 0.2, 0.02
ELSEWHERE_S = (-3.1, -2.3, -1.6, 1.6, 2.3, 3.1)
"""From a blink to the times whose wobble stands for the eye's noise."""


@dataclass(frozen=True)
class Asymmetry:
    """What an eye does at the blinks of the other.

    Attributes
    ----------
    share : float
        Median depth of its movement there, as part of the other's.
    blinks : int
        Blinks of the other at which it was seen.
    moves : bool
        Whether that is more than its noise.
    """

    share: float
    blinks: int
    moves: bool

    @property
    def is_weak(self) -> bool:
        """Whether the eye moves much less than the other."""
        return not self.moves or self.share < MUCH_LESS


def asymmetry(pieces: Sequence[Piece], other: Sequence[Piece], told: Sequence[Array]) -> Asymmetry | None:
    """What an eye does at the blinks of the other; None where the other has none at which it is seen.

    Parameters
    ----------
    pieces : sequence of Piece
        Of the eye.
    other, told : sequence of Piece, of float64 array (dips, kinds)
        Of the other eye looked at by itself, and what each dip is then.
    """
    own = _depth(pieces)
    moved, full, elsewhere = [], [], []
    for piece, probabilities in zip(other, told, strict=True):
        whole = _depth([piece])
        for candidate, row in zip(piece.candidates, probabilities, strict=True):
            if row[CLASSES.index("blink")] < LIKELY:
                continue
            moved.append(_movement(own, candidate, piece, 0.0))
            full.append(_movement(whole, candidate, piece, 0.0))
            elsewhere += [_movement(own, candidate, piece, away) for away in ELSEWHERE_S]
    known = np.isfinite(moved) & np.isfinite(full) & (np.array(full) > 0)
    if not known.any():
        return None
    return _judged(np.array(moved)[known], np.array(full)[known], np.array(elsewhere))


def _judged(moved: Array, full: Array, elsewhere: Array) -> Asymmetry:
    noise = elsewhere[np.isfinite(elsewhere)]
    # Median and its error by deviations: some of the times elsewhere hold a blink.
    sd = 1.4826 * float(np.median(np.abs(noise - np.median(noise)))) if noise.size else 0.0
    # 1.25 sd / sqrt(n) is the standard error of a median of normal values.
    least = NOISES * 1.25 * sd / np.sqrt(moved.size)
    share = float(np.median(moved / full))
    return Asymmetry(share, moved.size, bool(share >= LEAST_MOVEMENT and np.median(moved) > least))


def _depth(pieces: Sequence[Piece]) -> Array:
    """Depth of an eye, not smoothed, to the end of its last piece; NaN in gaps."""
    ends = [piece.start + piece.depth.raw.size for piece in pieces]
    depth = np.full(max(ends, default=0), np.nan)
    for piece, end in zip(pieces, ends, strict=True):
        depth[piece.start : end] = piece.depth.raw
    return depth


def _movement(depth: Array, candidate: Candidate, piece: Piece, away_s: float) -> float:
    """Mean depth where a dip is deepest above the median around it; NaN where that is missing."""
    fps = piece.depth.fps
    start = piece.start + away_s * fps
    first, last = (start + edge for edge in (candidate.left[0], candidate.right[0]))
    core = _span(depth, start + candidate.left[2] - CORE_S * fps, start + candidate.right[2] + CORE_S * fps)
    flanks = np.concatenate(
        [_span(depth, first - FLANK_S * fps, first), _span(depth, last, last + FLANK_S * fps)]
    )
    if not np.isfinite(core).any() or not np.isfinite(flanks).any():
        return float("nan")
    return float(np.nanmean(core) - np.nanmedian(flanks))


def _span(depth: Array, start: float, stop: float) -> Array:
    """Frames from `start` to `stop`, those that are there."""
    return depth[max(0, round(start)) : max(0, round(stop) + 1)]
