"""Measure labeled blinks: phases, amplitude, velocities, complete or partial; and cut their profiles."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from experiments.errors import InputError
from stimuli_builder.blinks.events.rules import LidEvent
from stimuli_builder.blinks.labelling import LabelledBlink, LabelOptions, RefusedMinimum
from stimuli_builder.blinks.profile import PROFILE_FPS, Array
from stimuli_builder.blinks.series import BlinkSeries, box_filter, scaled_frames

COMPLETE_FROM = 0.95
"""Closure from which a blink counts as complete: less is left open than the closed reference is sure of."""
DEEPEST_SHARE = 0.25
PLAUSIBLE_PHASES_MS = ((15.0, 400.0), (30.0, 1000.0), (60.0, 1300.0))
"""Closing, opening and duration within which a blink's phases are believed: wider than those of patients and
of sleepy people (Caffier et al. 2003; VanderWerf et al. 2003)."""
KNOWN_SHARE = 0.25
"""A duration of which more than this part is uncertain (one standard error) is not believed."""


@dataclass(frozen=True)
class MeasuredBlink:
    """One row of the blinks table; frames are the series' own, distances in its unit.

    The closure takes the line between the resting levels before and after as open (0) and the recording's
    closed level as closed (1). Velocities are of the filtered distance, in its unit per second. `amplitude`
    is the fall from the open level to the minimum, of the fitted curve if there is one, `closure` the
    greatest closure. `rest_before` and `rest_after` give how far the resting eye was open before and after:
    closure against the wider of the two. `probability` and the closed phase are the classifier's, and NaN by
    the paper's rule; with it, times lie between frames. The errors are one standard error of each phase, by
    the fit of the phases.
    """

    number: int
    column: str
    onset_frame: int
    minimum_frame: int
    end_frame: int
    onset_s: float
    minimum_s: float
    end_s: float
    down_frames: int
    up_frames: int
    down_ms: float
    up_ms: float
    duration_ms: float
    open_distance: float
    minimum_distance: float
    closed_distance: float
    amplitude: float
    closure: float
    complete: bool
    peak_closing_velocity: float
    peak_opening_velocity: float
    rest_before: float
    rest_after: float
    touches_neighbour: bool
    probability: float = float("nan")
    closed_from_s: float = float("nan")
    closed_to_s: float = float("nan")
    down_error_ms: float = float("nan")
    up_error_ms: float = float("nan")
    duration_error_ms: float = float("nan")
    plausible: bool = True


def closed_level(smooth: Array, blinks: Sequence[LabelledBlink], given: float | None = None) -> float:
    """Distance at lid contact: the value given, else the mean minimum of the recording's deepest blinks.

    An eye aspect ratio does not reach 0 when the lids meet; the deepest quarter of the blinks, at least two,
    shows where it stops. A single deepest one would depend on noise.
    """
    if given is not None:
        return given
    minima = np.sort([smooth[blink.minimum] for blink in blinks])
    # Two at least, or all there are.
    count = min(len(minima), max(2, round(DEEPEST_SHARE * len(minima))))
    return float(minima[:count].mean())


def not_below(closed: float, what: str, opening: float) -> InputError:
    """The refusal of a `--closed` at which what is open would be shut."""
    return InputError(
        f"--closed {closed:g} is not below the opening of {what} (up to {opening:g}); it must be the "
        "distance that remains when the lids meet"
    )


def smooth_distance(series: BlinkSeries, options: LabelOptions) -> Array:
    """Filtered distance; frames next to a gap are averaged over what there is, gaps stay NaN."""
    known = np.isfinite(series.distance)
    # The width is given at 300 fps.
    width = scaled_frames(options.filter_frames, series.fps)
    if known.all():
        return box_filter(series.distance, width)
    # The same filter over what is known: the share of its window that has values.
    share = box_filter(known.astype(np.float64), width)
    total = box_filter(np.where(known, series.distance, 0.0), width)
    return np.where(known, total / np.maximum(share, 1e-12), np.nan)


def measure_blinks(
    series: BlinkSeries,
    blinks: Sequence[LabelledBlink],
    options: LabelOptions,
    *,
    closed_distance: float | None = None,
    complete_from: float = COMPLETE_FROM,
) -> tuple[list[MeasuredBlink], list[RefusedMinimum]]:
    """Measure every labeled blink; the closed level is the recording's (see `closed_level`).

    Returns
    -------
    measured, refused
        A blink that begins or ends no further open than the closed level has no closure and is refused.

    Raises
    ------
    InputError
        The closed distance given is not below the opening of any blink.
    """
    if not blinks:
        return [], []
    smooth = smooth_distance(series, options)
    closed = closed_level(smooth, blinks, closed_distance)
    levels = [open_levels(smooth, blink) for blink in blinks]
    # The line of open levels must lie above the closed one, or closure has no sign.
    fit = [blink for blink, around in zip(blinks, levels, strict=True) if closed < min(around)]
    if not fit and closed_distance is not None:
        widest = max(before for before, _ in levels)
        raise not_below(closed, f"any blink of '{series.column}'", widest)
    reason = f"it begins or ends at or below the closed distance {closed:.3g}"
    refused = [RefusedMinimum(blink.minimum, reason) for blink in blinks if blink not in fit]
    # From the filtered distance: a difference of raw frames would be noise times the frame rate.
    velocity = np.gradient(smooth) * series.fps
    measured = [
        _measure(series, blink, number, smooth, velocity, closed, complete_from)
        for number, blink in enumerate(fit, start=1)
    ]
    return measured, refused


def _measure(
    series: BlinkSeries,
    blink: LabelledBlink,
    number: int,
    smooth: Array,
    velocity: Array,
    closed: float,
    complete_from: float,
) -> MeasuredBlink:
    fps, least = series.fps, float(smooth[blink.minimum])
    onset_s, minimum_s, end_s = _times(blink, fps)
    # The open level at the minimum: a lid seldom reopens as far as it was.
    open_distance = float(np.interp(minimum_s, [onset_s, end_s], open_levels(smooth, blink)))
    amplitude = open_distance - least
    # The mean of the deepest quarter is the closed level, so that about half of those blinks go beyond
    # it.
    closure = min(1.0, amplitude / (open_distance - closed))
    before, after = _rests(smooth, blink, fps, closed)
    event = blink.event
    # The fit rests on all frames of the blink, not on the lowest alone.
    if event is not None and event.fit is not None:
        amplitude = event.fit.fallen
    errors_ms = (np.nan,) * 3 if event is None else _errors_ms(event)
    phases_ms = ((minimum_s - onset_s) * 1000, (end_s - minimum_s) * 1000, (end_s - onset_s) * 1000)
    return MeasuredBlink(
        number=number,
        column=series.column,
        onset_frame=blink.onset,
        minimum_frame=blink.minimum,
        end_frame=blink.end,
        onset_s=onset_s,
        minimum_s=minimum_s,
        end_s=end_s,
        down_frames=blink.minimum - blink.onset,
        up_frames=blink.end - blink.minimum,
        down_ms=phases_ms[0],
        up_ms=phases_ms[1],
        duration_ms=phases_ms[2],
        open_distance=open_distance,
        minimum_distance=least,
        closed_distance=closed,
        amplitude=amplitude,
        closure=closure,
        complete=closure >= complete_from,
        # Closing makes the distance smaller: the speed is the negative of the least slope.
        peak_closing_velocity=float(-velocity[blink.onset : blink.minimum + 1].min()),
        peak_opening_velocity=float(velocity[blink.minimum : blink.end + 1].max()),
        rest_before=before,
        rest_after=after,
        touches_neighbour=blink.touches_neighbour,
        probability=float("nan") if event is None else event.probability,
        closed_from_s=float("nan") if event is None else event.closed_from_s,
        closed_to_s=float("nan") if event is None else event.closed_to_s,
        down_error_ms=errors_ms[0],
        up_error_ms=errors_ms[1],
        duration_error_ms=errors_ms[2],
        # Moved times are not those of the fit, so its errors do not apply.
        plausible=_plausible(phases_ms, errors_ms[2], by_fit=event is not None and not event.is_moved),
    )


def _errors_ms(event: LidEvent) -> tuple[float, float, float]:
    fit = event.fit
    if fit is None:
        return np.nan, np.nan, np.nan
    return fit.down_error_s * 1000, fit.up_error_s * 1000, fit.duration_error_s * 1000


def _plausible(phases_ms: tuple[float, float, float], error_ms: float, *, by_fit: bool) -> bool:
    """Whether lids move so: phases within `PLAUSIBLE_PHASES_MS`, and by the fit known well enough."""
    inside = all(low <= ms <= high for ms, (low, high) in zip(phases_ms, PLAUSIBLE_PHASES_MS, strict=True))
    # A comparison with NaN is false: without an error a fitted duration is not believed.
    return inside and (not by_fit or error_ms <= KNOWN_SHARE * phases_ms[2])


def open_levels(smooth: Array, blink: LabelledBlink) -> tuple[float, float]:
    """Distance of the resting lid before and after a blink: by the fit of its phases, else at its edges.

    A fitted blink begins where 5% of its amplitude is gone, so that its edges lie below the open level.
    """
    event = blink.event
    if event is not None and event.fit is not None:
        return event.fit.open_before, event.fit.open_after
    return float(smooth[blink.onset]), float(smooth[blink.end])


def _times(blink: LabelledBlink, fps: float) -> tuple[float, float, float]:
    """Onset, minimum and end in seconds: the event's, between frames, or the labeled frames'."""
    if blink.event is None:
        return blink.onset / fps, blink.minimum / fps, blink.end / fps
    return blink.event.onset_s, blink.event.minimum_s, blink.event.end_s


def open_line(smooth: Array, onset: int, end: int) -> Callable[[ArrayLike], Array]:
    """Open level during a blink: the line from its onset to its end.

    Eyes seldom reopen exactly as far as they were; against this line a profile begins and ends at 0,
    and nothing jumps where an animation joins it to an open eye.
    """
    levels = [float(smooth[onset]), float(smooth[end])]
    return lambda frame: np.asarray(np.interp(np.asarray(frame, dtype=np.float64), [onset, end], levels))


def _rests(smooth: Array, blink: LabelledBlink, fps: float, closed: float) -> tuple[float, float]:
    """Closure of the resting eye before and after, against the wider: medians over 100 frames at 300 fps,
    the later ones 50 frames after the end, when the lid has settled."""
    reach, pause = round(scaled_frames(100, fps)), round(scaled_frames(50, fps))
    before = smooth[max(0, blink.onset - reach) : blink.onset + 1]
    after = smooth[blink.end + pause : blink.end + pause + reach]
    levels = [
        float(np.nanmedian(before)) if np.isfinite(before).any() else float(smooth[blink.onset]),
        float(np.nanmedian(after)) if np.isfinite(after).any() else float(smooth[blink.end]),
    ]
    widest = max(levels)
    # Eyes that rest at the closed level have no opening to compare with.
    if widest <= closed:
        return 0.0, 0.0
    return (widest - levels[0]) / (widest - closed), (widest - levels[1]) / (widest - closed)


def at_300(values: Array, fps: float, onset: int, minimum: int, end: int) -> tuple[Array, int]:
    """Resample one blink, onset to end, to 300 fps by a monotone spline; return the sample of its minimum.

    Its time is laid so that the minimum falls on a sample and the ends on the last whole ones.
    """
    # At least one sample for each phase, or a profile would have none.
    before = max(1, round((minimum - onset) * PROFILE_FPS / fps))
    after = max(1, round((end - minimum) * PROFILE_FPS / fps))
    frames = np.concatenate(
        # The minimum is in both parts and counts once.
        [np.linspace(onset, minimum, before + 1), np.linspace(minimum, end, after + 1)[1:]]
    )
    # Monotone: a common cubic would overshoot at the closed phase and open the lid before it opens.
    spline = PchipInterpolator(np.arange(onset, end + 1), values[onset : end + 1])
    return np.asarray(spline(frames)), before


def closure_at_300(
    smooth: Array, fps: float, onset: int, minimum: int, end: int, closed: float
) -> tuple[Array, int]:
    """Closure of one blink at 300 fps, and the sample of its minimum.

    Closure is cut to [0, 1]: a lid that met the other moves no further.
    """
    level = open_line(smooth, onset, end)(np.arange(smooth.size))
    closure, before = at_300((level - smooth) / (level - closed), fps, onset, minimum, end)
    return np.clip(closure, 0.0, 1.0), before


def lid_motion_at_300(
    place_mm: Array | None, fps: float, onset: int, minimum: int, end: int, width_frames: float
) -> Array | None:
    """Lower lid's motion in one blink at 300 fps, against the line from onset to end; None if unknown."""
    # A gap inside the blink cannot be filled by the usual motion of lids.
    if place_mm is None or not np.isfinite(place_mm[onset : end + 1]).all():
        return None
    reach = int(np.ceil(width_frames))
    # The filter needs room on both sides of the blink.
    first = max(0, onset - reach)
    part = place_mm[first : end + 1 + reach]
    # Only the margin for the filter may have gaps: the blink itself is known.
    known = np.where(np.isfinite(part), part, place_mm[minimum])
    smooth = box_filter(known, width_frames)
    frames = np.arange(smooth.size)
    moved = smooth - open_line(smooth, onset - first, end - first)(frames)
    return np.round(at_300(moved, fps, onset - first, minimum - first, end - first)[0], 6)
