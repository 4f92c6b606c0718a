"""Cut the profiles of measured blinks out of their series, one eye at a time or both together."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from experiments.errors import InputError, counted
from stimuli_builder.blinks.events.recognise import RecognisedEvents
from stimuli_builder.blinks.events.rules import LidEvent
from stimuli_builder.blinks.labelling import (
    LabelledBlink,
    LabelOptions,
    RefusedMinimum,
    find_blinks,
    turning_frame,
)
from stimuli_builder.blinks.measure import (
    MeasuredBlink,
    closure_at_300,
    lid_motion_at_300,
    measure_blinks,
    not_below,
    smooth_distance,
)
from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array, BlinkProfile, Eye
from stimuli_builder.blinks.series import BlinkSeries, scaled_frames

# Labeled blinks from the classifier's events: their frames, and neighbors that touch.

CUT = "its start or end is in a gap or outside the recording"


def recognised_blinks(
    series: BlinkSeries, recognised: RecognisedEvents, options: LabelOptions
) -> tuple[list[LabelledBlink], list[RefusedMinimum]]:
    """Turn the blinks among the events of one eye into labeled blinks.

    Returns
    -------
    blinks, refused
        Blinks cut by a gap or by an end of the recording are refused.
    """
    smooth = smooth_distance(series, options)
    # Only blinks: a squint next to a blink does not end it.
    events = _parted([event for event in recognised.events if event.kind == "blink"], smooth, series.fps)
    blinks = [_labelled(event, touches, smooth, series.fps, options) for event, touches in events]
    refused = [RefusedMinimum(frame, CUT) for frame in recognised.cut]
    refused += [
        RefusedMinimum(event.frame, CUT)
        for (event, _), blink in zip(events, blinks, strict=True)
        if not blink
    ]
    return [blink for blink in blinks if blink], sorted(refused, key=lambda one: one.minimum)


def _parted(events: Sequence[LidEvent], smooth: Array, fps: float) -> list[tuple[LidEvent, bool]]:
    """Part blinks that touch at the widest opening between them."""
    parted = [(event, False) for event in events]
    for index, (first, second) in enumerate(pairwise(list(events))):
        # They do not touch.
        if first.end_s < second.onset_s:
            continue
        between = smooth[first.frame : second.frame + 1]
        # Next to each other or in a gap: there is no opening to part them at.
        if between.size < 3 or not np.isfinite(between).any():
            continue
        widest = (first.frame + int(np.nanargmax(between))) / fps
        # From `parted`, since its onset may have moved with the blink before.
        parted[index] = (replace(parted[index][0], end_s=widest), True)
        parted[index + 1] = (replace(second, onset_s=widest), True)
    return parted


def _labelled(
    event: LidEvent, touches: bool, smooth: Array, fps: float, options: LabelOptions
) -> LabelledBlink | None:
    # A frame on either side of the deepest at least, whatever the fitted times round to.
    onset = max(0, min(round(event.onset_s * fps), event.frame - 1))
    end = min(smooth.size - 1, max(round(event.end_s * fps), event.frame + 1))
    # At an end of the recording a side may be missing.
    if not onset < event.frame < end or not np.isfinite(smooth[onset : end + 1]).all():
        return None
    # Between the edges only: an edge can be lower where a neighbor touches.
    lowest = onset + 1 + int(np.argmin(smooth[onset + 1 : end]))
    minimum = turning_frame(smooth, onset, lowest, end, options.minimum_tolerance)
    # A phase of at least one frame on either side.
    return LabelledBlink(
        onset, max(onset + 1, min(minimum, end - 1)), end, event.depth, float("nan"), touches, event
    )


LID_FILTER_FRAMES = 10
PLAUSIBLE_MS = (120, 600)
"""Median durations that are believed: 330 ms is usual."""
USUAL_CLOSING_MS = (45, 120)
USUAL_SPEED = (14, 26.5)
"""Peak closing velocity over amplitude, per second (main sequence). A rate off by a factor of two puts it and
the closing time outside, on opposite sides; a person seldom has both there."""
TELLING_FPS = 60
TESTED_FPS = (15, 1000)


@dataclass(frozen=True, eq=False)
class EyeBlinks:
    """The blinks of one column: the series, its filtered distance, every blink measured, what was refused.

    `recognised` is the classifier's result; None with the paper's rule.
    """

    series: BlinkSeries
    smooth: Array
    blinks: tuple[MeasuredBlink, ...]
    refused: tuple[RefusedMinimum, ...]
    recognised: RecognisedEvents | None = None

    @property
    def events(self) -> tuple[LidEvent, ...]:
        """All lid events of the classifier, other than blinks too; none by the paper's rule."""
        return () if self.recognised is None else self.recognised.events

    def closed_distance(self, given: float | None) -> float | None:
        """Distance at lid contact: its blinks', else the one given; None if it is unknown.

        Raises
        ------
        InputError
            There is no blink, and the one given is not below the opening: noise would shut the eye.
        """
        if self.blinks or given is None:
            return self.blinks[0].closed_distance if self.blinks else None
        opening = float(np.nanpercentile(self.series.distance, OPEN_PERCENTILE))
        if given >= opening:
            raise not_below(given, f"'{self.series.column}'", opening)
        return given

    @property
    def seconds(self) -> float:
        """How long the eye was seen."""
        return (self.series.distance.size - self.series.missing_frames) / self.series.fps


def blinks_of(
    series: BlinkSeries,
    options: LabelOptions,
    *,
    closed_distance: float | None = None,
    complete_from: float = 0.95,
    edges: Mapping[int, tuple[int, int]] = MappingProxyType({}),
    recognised: RecognisedEvents | None = None,
) -> EyeBlinks:
    """Label and measure one series.

    Parameters
    ----------
    edges : mapping of int to (int, int), optional
        By minimum frame, an (onset, end) of a person's that takes the place of the labeled one.
    recognised : Recognized, optional
        Result of `recognise` for this series; None labels by the paper's rule with `options`.
    """
    if recognised is None:
        labelled, refused = find_blinks(series.distance, series.fps, options, is_px=series.is_px)
    else:
        labelled, refused = recognised_blinks(series, recognised, options)
    # Reviews name a blink by its minimum, which does not move with its edges.
    labelled = [_moved(series, blink, edges.get(blink.minimum)) for blink in labelled]
    measured, flat = measure_blinks(
        series, labelled, options, closed_distance=closed_distance, complete_from=complete_from
    )
    return EyeBlinks(series, smooth_distance(series, options), tuple(measured), (*refused, *flat), recognised)


def _moved(series: BlinkSeries, blink: LabelledBlink, edges: tuple[int, int] | None) -> LabelledBlink:
    if edges is None:
        return blink
    onset, end = edges
    last = series.distance.size - 1
    if end > last:
        raise InputError(f"the review ends a blink of {series.column} at frame {end}; the last is {last}")
    # The profile would have to invent what lies in the gap.
    if not np.isfinite(series.distance[onset : end + 1]).all():
        raise InputError(
            f"the review moves a blink of {series.column} ({onset} to {end}) over frames without a value"
        )
    event = blink.event
    if event is not None:
        # A fit of the former phases does not hold for the new ones.
        event = replace(event, onset_s=onset / series.fps, end_s=end / series.fps, fit=None, is_moved=True)
    return replace(blink, onset=onset, end=end, event=event)


def why_no_blink(eye: EyeBlinks, options: LabelOptions) -> str:
    """A line on a series without a blink."""
    return f"no blink in column '{eye.series.column}': {_why_none(eye, options)}"


def _why_none(eye: EyeBlinks, options: LabelOptions) -> str:
    """What a series without a blink holds instead, or why its blinks could not be measured."""
    if eye.refused:
        first = eye.refused[0]
        more = f"{counted(len(eye.refused), 'dip')} could not be measured; the first is"
        return f"{more} at frame {first.minimum}: {first.reason}"
    others = Counter(event.kind.replace("_", " ") for event in eye.events if event.kind != "blink")
    # The 90th percentile is the open eye, despite blinks.
    deepest = 1 - np.nanmin(eye.smooth) / max(float(np.nanquantile(eye.smooth, 0.9)), 1e-9)
    what = f"its deepest dip is {deepest:.0%} of the opening"
    if others:
        what += f", it has {', '.join(f'{count} x {kind}' for kind, count in others.items())}"
    elif eye.recognised is None and deepest < options.minimum_depth:
        what += f", a blink needs {options.minimum_depth:.0%} (--minimum-depth)"
    return f"{what}; check the column and --fps"


def without_blinks(eyes: Sequence[EyeBlinks]) -> list[str]:
    """A line about each column in which there is no blink."""
    return [f"{eye.series.column}: no blinks in {eye.seconds:.0f} s" for eye in eyes if not eye.blinks]


def rate_doubts(eyes: Sequence[EyeBlinks]) -> list[str]:
    """Lines about a rate at which the classifier was not tested, and one by which blinks do not last so."""
    fps, lines = eyes[0].series.fps, []
    # The paper's rule scales with any rate.
    if eyes[0].recognised is not None and not TESTED_FPS[0] <= fps <= TESTED_FPS[1]:
        lines.append(
            f"the classifier was tested at {TESTED_FPS[0]} to {TESTED_FPS[1]:,} frames per second, but this "
            f"is {fps:.4g}: check its result with --plot"
        )
    doubt = _rate_doubt(eyes)
    return [*lines, doubt] if doubt else lines


def speed_doubt(eyes: Sequence[EyeBlinks]) -> list[str]:
    """A line about peak speeds where frames are few; empty without blinks."""
    fps = eyes[0].series.fps
    # 59.94 counts as 60.
    if round(fps) >= TELLING_FPS or not any(eye.blinks for eye in eyes):
        return []
    return [
        f"at {fps:.4g} frames per second peak closing velocities are too low (by 11 to 37% at 30, 16 to 47% "
        "at 24 frames per second, the more the faster the lid); compare them only within one rate"
    ]


def _rate_doubt(eyes: Sequence[EyeBlinks]) -> str:
    """Why the rate of a recording may be wrong, in words; empty where its blinks last as blinks do.

    Both eyes have one rate, so that the blinks of all columns are looked at together.
    """
    blinks = [blink for eye in eyes for blink in eye.blinks if blink.plausible]
    if not blinks:
        return ""
    fps = eyes[0].series.fps
    # Medians: single blinks may be anything.
    duration_ms = float(np.median([blink.duration_ms for blink in blinks]))
    closing_ms = float(np.median([blink.down_ms for blink in blinks]))
    # Over the amplitude, since larger blinks are faster.
    speed = float(np.median([blink.peak_closing_velocity / blink.amplitude for blink in blinks]))
    # Under 60 fps the filter and the frames, not the lid, rule how fast a blink seems to be.
    slow = closing_ms > USUAL_CLOSING_MS[1] and (speed < USUAL_SPEED[0] or fps < TELLING_FPS)
    fast = closing_ms < USUAL_CLOSING_MS[0] and (speed > USUAL_SPEED[1] or fps < TELLING_FPS)
    if PLAUSIBLE_MS[0] <= duration_ms <= PLAUSIBLE_MS[1] and not slow and not fast:
        return ""
    return (
        f"at {fps:.4g} fps the blinks last {duration_ms:.0f} ms and close in {closing_ms:.0f} ms (medians), "
        f"where {PLAUSIBLE_MS[0]}-{PLAUSIBLE_MS[1]} and {USUAL_CLOSING_MS[0]}-{USUAL_CLOSING_MS[1]} are "
        "usual: check --fps"
    )


def eye_profile(
    eye_blinks: EyeBlinks, blink: MeasuredBlink, recording: str, eye: Eye | None, label: str = ""
) -> BlinkProfile:
    """Return the profile of one blink of one eye at 300 fps; its name holds eye, label or column."""
    closure, minimum = closure_at_300(
        eye_blinks.smooth,
        eye_blinks.series.fps,
        blink.onset_frame,
        blink.minimum_frame,
        blink.end_frame,
        blink.closed_distance,
    )
    return BlinkProfile(
        profile_id=f"{recording}-{eye or label or eye_blinks.series.column}-{blink.number:02d}",
        closure=np.round(closure, 6),
        minimum_index=minimum,
        # The profile begins with the onset, so the minimum is as far from its first sample.
        down_frames=minimum,
        up_frames=closure.size - 1 - minimum,
        amplitude=round(float(closure.max()), 6),
        source=f"recorded: {recording}, {eye_blinks.series.column}, blink {blink.number}",
        eye=eye,
        recording=recording,
        lower_up_mm=_lid(eye_blinks, eye_blinks.series.lower_up_mm, blink),
        lower_nasal_mm=_lid(eye_blinks, eye_blinks.series.lower_nasal_mm, blink),
        rest_before=round(blink.rest_before, 6),
        rest_after=round(blink.rest_after, 6),
    )


def _lid(eye_blinks: EyeBlinks, place_mm: Array | None, blink: MeasuredBlink) -> Array | None:
    fps = eye_blinks.series.fps
    width = scaled_frames(LID_FILTER_FRAMES, fps)
    return lid_motion_at_300(place_mm, fps, blink.onset_frame, blink.minimum_frame, blink.end_frame, width)


def eye_profiles(
    eye_blinks: EyeBlinks, recording: str, eye: Eye | None, label: str = ""
) -> list[BlinkProfile]:
    """Return the profile of every blink of one eye."""
    return [eye_profile(eye_blinks, blink, recording, eye, label) for blink in eye_blinks.blinks]
