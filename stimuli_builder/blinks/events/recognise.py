"""From lid series to events: what each dip is, how sure that is, and when it happened."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stimuli_builder.blinks.columns import eye_pair
from stimuli_builder.blinks.events.candidates import (
    CLASSES,
    CLOSED_EYE_S,
    LEVELS,
    RIPPLE,
    Candidate,
    Depth,
    candidate_at,
    level_crossing,
)
from stimuli_builder.blinks.events.network import Piece, looked_at, partners, second_look
from stimuli_builder.blinks.events.rules import (
    Asymmetry,
    LidEvent,
    PhaseFit,
    asymmetry,
    separate_events,
    with_long_closures,
    with_winks,
)
from stimuli_builder.blinks.events.template import (
    CLOSED,
    RestingLid,
    Timing,
    bounds_of,
    rests_about,
    timing_of,
)
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries

LEAST_PROBABILITY = 0.5
BLINK_TO_SQUINT = 10.0
"""What would be a blink is a squint where it is not this much likelier a blink. Brief squints are partial
blinks but for slower lids, and rarer: by the likelier of both one in eleven to eighteen of them is called a
blink (decision 0957)."""
STILL_CLOSED = 0.8
"""Part of its depth at which a lid that stays closed for half a second is for most of that time. A blink on a
gaze shift down comes back to where the gaze leaves it, and the template takes that for its closed phase."""
HALF_A_BLINK_S = 0.5
"""A lid that closes or opens in a blink has reached the level it came from, or goes to, within this time."""
SHUT_DEPTH, GLITCH_S = 0.8, 0.06
"""Part of the depth of an eye's blinks, and time at half height, from which a dip is never nothing."""
HELD = ("squint", "gaze_shift", "closed_eye")
RIPPLE_SHARE = 0.6
"""Part of a dip by which a blink rises above the rests next to it; less is a blink on a lowered lid, or a lid
that is held and trembles."""
SURE_OF_A_RIPPLE = 0.6
"""Probability from which such a rise is a blink all the same; blinks on a lowered lid have more than 0.99."""
ONE_BLINK_S = 0.2
"""Two dips closer than this are one blink seen twice by a noisy tracker; the likelier one stays."""


@dataclass(frozen=True)
class RecognisedEvents:
    """Events of one eye in order of time, and the deepest frames of blinks whose start or end is missing.

    An eye may blink or be shut while it is lowered (squint, gaze shift); else no two of its events overlap.
    `asymmetry` is what this eye does at the blinks of the other; None where no such blink is seen. `winks_s`
    are the deepest moments of its blinks at which the other eye stays open, of two eyes that both blink.
    """

    events: tuple[LidEvent, ...]
    cut: tuple[int, ...]
    asymmetry: Asymmetry | None = None
    winks_s: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class _PieceEvents:
    """Events of a piece, what a blink is instead where a squint may well explain it, and cut blinks.

    `squints` and `cut` are by the deepest frame of the series.
    """

    events: list[LidEvent]
    squints: dict[int, LidEvent]
    cut: list[int]


@dataclass(frozen=True, eq=False)
class _Look:
    """Pieces of an eye and the probabilities (dips, kinds) of their dips."""

    pieces: list[Piece]
    told: list[Array]


def recognise(eyes: Sequence[BlinkSeries]) -> list[RecognisedEvents]:
    """Return the events of each series; two series are taken as the two eyes of one face.

    If there are more, those named as one left and one right eye are the pair; others are judged separately.
    """
    pair = (0, 1) if len(eyes) == 2 else eye_pair([eye.column for eye in eyes])
    of_pair = {} if pair is None else dict(zip(pair, _of_one_face([eyes[k] for k in pair]), strict=True))
    return [of_pair.get(k) or _recognised(_looks([eye])[0], eye, None) for k, eye in enumerate(eyes)]


def _of_one_face(eyes: Sequence[BlinkSeries]) -> list[RecognisedEvents]:
    """The events of both eyes; one is judged by itself where it does not move, or its fellow much less."""
    # Both ways are computed: which one counts is known only once either eye was judged by itself.
    together = _looks(eyes)
    alone = [_looks([eye])[0] for eye in eyes]
    sides = [asymmetry(alone[k].pieces, alone[1 - k].pieces, alone[1 - k].told) for k in range(2)]
    depths = [_of_length(depth, eyes[0].distance.size) for depth in partners([one.pieces for one in alone])]
    results = []
    for k, eye in enumerate(eyes):
        own, other = sides[k], sides[1 - k]
        # A weak eye's partner is judged alone, and an eye that does not move is not called blinking for its
        # partner's blinks.
        by_itself = (other is not None and other.is_weak) or (own is not None and not own.moves)
        result = _recognised((alone if by_itself else together)[k], eye, own)
        if not by_itself and not (own is not None and own.is_weak):
            lone = _recognised(alone[k], eye, own).events
            events, winks_s = with_winks(result.events, lone, depths[1 - k], depths[k], eye.fps)
            result = replace(result, events=tuple(events), winks_s=tuple(winks_s))
        results.append(result)
    return results


def _of_length(depth: Array | None, size: int) -> Array:
    """A depth (n,) as long as its series; NaN where it was not seen."""
    known = np.empty(0) if depth is None else depth
    return np.pad(known, (0, size - known.size), constant_values=np.nan)


def _looks(eyes: Sequence[BlinkSeries]) -> list[_Look]:
    """Both looks at each series, two as the eyes of one face."""
    pieces = looked_at(eyes)
    return [_Look(*look) for look in zip(pieces, second_look(pieces), strict=True)]


def _recognised(look: _Look, eye: BlinkSeries, side: Asymmetry | None) -> RecognisedEvents:
    events: list[LidEvent] = []
    cut: list[int] = []
    for piece, of_piece in zip(look.pieces, look.told, strict=True):
        told = _judged(piece, of_piece, eye.fps)
        cut += told.cut
        events += separate_events(_listed(told), piece.depth.smooth, piece.start, eye.fps)
    return RecognisedEvents(tuple(with_long_closures(eye.distance, eye.fps, events)), tuple(cut), side)


def _judged(piece: Piece, probabilities: Array, fps: float) -> _PieceEvents:
    """What each dip of a piece is, by its probabilities (dips, kinds)."""
    told = _PieceEvents([], {}, [])
    bounds = bounds_of(piece.candidates, piece.depth)
    for candidate, row, bound in zip(piece.candidates, probabilities, bounds, strict=True):
        # A blink at its own limit first, as blinks are what is counted; only then the likeliest of all.
        shares = dict(zip(CLASSES, row.tolist(), strict=True))
        sure = shares["blink"] >= LEAST_PROBABILITY
        likeliest = "blink" if sure else max(shares, key=shares.__getitem__)
        if likeliest == "nothing" and _shuts(candidate, piece):
            likeliest = max(HELD, key=shares.__getitem__)
        if likeliest == "nothing":
            continue
        explained = shares["blink"] < BLINK_TO_SQUINT * shares["squint"]
        if _cut(candidate, piece.depth):
            told.cut.extend([piece.start + candidate.peak] if likeliest == "blink" and not explained else [])
            continue
        kind, timing = _phases(likeliest, sure, candidate, piece.depth, bound)
        if kind == "blink" and _is_ripple(timing, candidate, shares["blink"]):
            kind, timing = max(HELD, key=shares.__getitem__), _crossed(candidate, fps)
            likeliest = kind
        event = _event(kind, shares[likeliest], candidate, timing, piece)
        told.events.append(event)
        if kind == "blink" and explained:
            timing = _crossed(candidate, fps)
            squint = _event("squint", shares["squint"], candidate, timing, piece)
            told.squints[event.frame] = squint
    return told


def _shuts(candidate: Candidate, piece: Piece) -> bool:
    """Whether a dip goes as deep as the eye's blinks, for longer than a glitch: some event."""
    held_s = (candidate.right[1] - candidate.left[1]) / piece.depth.fps
    return candidate.prominence >= SHUT_DEPTH * piece.deep and held_s >= GLITCH_S


def _is_ripple(timing: Timing, candidate: Candidate, probability: float) -> bool:
    """Whether a dip is a lid that is held and trembles: not surely a blink, and little above its rests."""
    if timing.fitted is None or probability >= SURE_OF_A_RIPPLE:
        return False
    return timing.fitted.amplitude < RIPPLE_SHARE * candidate.prominence


def _listed(told: _PieceEvents) -> list[LidEvent]:
    """The events, squints in place of blinks that they explain; a ripple of a closed eye stays a blink."""
    closed = [event for event in told.events if event.kind == "closed_eye"]
    listed = []
    for event in _single(told.events, told.squints):
        squint = told.squints.get(event.frame)
        shut = any(eye.onset_s <= event.minimum_s <= eye.end_s for eye in closed)
        listed.append(event if squint is None or event.kind != "blink" or shut else squint)
    return listed


def _phases(
    kind: str, sure: bool, candidate: Candidate, depth: Depth, bounds: tuple[int, int]
) -> tuple[str, Timing]:
    """Phases of a dip; a blink is a closed eye where they say so."""
    if kind != "blink":
        return kind, _crossed(candidate, depth.fps)
    timing = _timed(candidate, depth, bounds)
    if timing.closed_s < CLOSED_EYE_S:
        return kind, timing
    above = _above_its_shoulders(timing, candidate, depth) if sure else None
    timing = timing if above is None else _crossed(above, depth.fps)
    return "closed_eye" if timing.closed_s >= CLOSED_EYE_S else "blink", timing


def _cut(candidate: Candidate, depth: Depth) -> bool:
    """Whether a dip is at the edge of its piece: its beginning or end was not seen."""
    return candidate.left[1] <= 0 or candidate.right[1] >= depth.smooth.size - 1


def _above_its_shoulders(timing: Timing, candidate: Candidate, depth: Depth) -> Candidate | None:
    """The dip as it rises out of a level at which the lid lies before or after it; None for a closed eye."""
    first, last = (round(time * depth.fps) for time in (timing.closed_from_s, timing.closed_to_s))
    phase = depth.smooth[max(0, first) : last + 1]
    if not phase.size or np.median(phase) >= STILL_CLOSED * candidate.depth:
        return None
    reach, peak = round(HALF_A_BLINK_S * depth.fps), candidate.peak
    base = max(
        float(depth.smooth[max(0, peak - reach) : peak + 1].min()),
        float(depth.smooth[peak : peak + reach + 1].min()),
    )
    prominence = candidate.depth - base
    if prominence < RIPPLE * candidate.depth:
        return None
    return candidate_at(depth, peak, prominence)


def _timed(candidate: Candidate, depth: Depth, bounds: tuple[int, int]) -> Timing:
    """Phases of a blink by the template, or by its crossings where the template slid off the dip."""
    rests = rests_about(candidate, depth, bounds)
    timing = timing_of(candidate, depth, rests)
    # The template may slide to a neighbor that is deeper: its middle must stay within the half height of
    # this dip.
    inside = candidate.left[1] <= timing.minimum_s * depth.fps <= candidate.right[1]
    onset, end = timing.onset_s * depth.fps, timing.end_s * depth.fps
    seen = rests[0].far <= onset and end <= rests[1].far + 1
    falls = timing.fitted is not None and timing.fitted.amplitude > 0
    return timing if inside and seen and falls else _crossed_to(candidate, rests, depth)


def _crossed_to(candidate: Candidate, rests: tuple[RestingLid, RestingLid], depth: Depth) -> Timing:
    """Phases of a blink that no template fits: the crossings of its way from one rest and to the other."""
    fps, peak = depth.fps, candidate.peak
    sides = []
    for step, rest in zip((-1, 1), rests, strict=True):
        way = candidate.depth - rest.level
        levels = [rest.level + part * way for part in (LEVELS[0], CLOSED)]
        sides.append([level_crossing(depth, peak, level, step) / fps for level in levels])
    before, after = sides
    return Timing(before[0], before[1], peak / fps, after[1], after[0])


def _crossed(candidate: Candidate, fps: float) -> Timing:
    """Phases of an event that is not a blink: the crossings of its prominence."""
    left, right = candidate.left, candidate.right
    return Timing(
        left[0] / fps,
        left[2] / fps,
        candidate.peak / fps,
        right[2] / fps,
        right[0] / fps,
    )


def _event(kind: str, probability: float, candidate: Candidate, timing: Timing, piece: Piece) -> LidEvent:
    shift = piece.start / piece.depth.fps
    return LidEvent(
        kind=kind,
        probability=probability,
        frame=piece.start + candidate.peak,
        # A fitted onset may lie before the piece, where nothing was measured.
        onset_s=max(0.0, timing.onset_s) + shift,
        closed_from_s=max(0.0, timing.closed_from_s) + shift,
        minimum_s=timing.minimum_s + shift,
        closed_to_s=timing.closed_to_s + shift,
        end_s=timing.end_s + shift,
        depth=candidate.depth,
        fit=_fit_of(timing, piece.depth),
    )


def _fit_of(timing: Timing, depth: Depth) -> PhaseFit | None:
    """Levels and errors of fitted phases in the unit of the series; None where no curve was fitted."""
    if timing.fitted is None:
        return None

    def opening(time_s: float) -> float:
        return float(depth.opening[min(max(0, round(time_s * depth.fps)), depth.opening.size - 1)])

    # Depths go back into the unit of the series by the opening about then.
    before, after = timing.fitted.before, timing.fitted.after
    return PhaseFit(
        (1 - before) * opening(timing.onset_s),
        (1 - after) * opening(timing.end_s),
        timing.fitted.amplitude * opening(timing.minimum_s),
        *timing.fitted.errors_s,
    )


def _single(events: list[LidEvent], squints: Collection[int]) -> list[LidEvent]:
    """Keep the likelier of two blinks too close to be two, of which one that is not a squint comes first."""
    kept: list[LidEvent] = []
    for event in sorted(events, key=lambda event: event.minimum_s):
        last = kept[-1] if kept else None
        both = last is not None and event.kind == last.kind == "blink"
        if last is not None and both and event.minimum_s - last.minimum_s < ONE_BLINK_S:
            kept[-1] = max(last, event, key=lambda one: (one.frame not in squints, one.probability))
        else:
            kept.append(event)
    return kept
