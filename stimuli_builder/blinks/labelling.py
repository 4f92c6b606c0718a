"""Find the blinks of a distance series: onset, minimum and end by the paper's two criteria (3.3.1)."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import percentile_filter
from scipy.signal import find_peaks

from experiments.errors import InputError, did_you_mean
from stimuli_builder.blinks.events.rules import LidEvent
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import PAPER_FPS, box_filter, scaled_frames
from stimuli_builder.blinks.times import runs

# The values of the labeling rule and their named sets.


@dataclass(frozen=True)
class LabelOptions:
    """Values of the labeling rule; all frame counts are at 300 fps, as the paper's, and scale with the rate.

    Exactly one of the three gradient limits is given.

    Parameters
    ----------
    filter_frames : float
        Width of the zero-phase filter.
    gradient_frames : float
        Window over which the gradient is averaged.
    gradient_peak : float or None
        Largest averaged gradient at onset and end, as part of the greatest one of the same phase.
    gradient_opening : float or None
        The same as part of the eye's opening per 300 fps frame.
    gradient_px : float or None
        The same in pixels per 300 fps frame (the paper's 0.1).
    opening_px : float
        Opening of the eye in pixels that `gradient_px` supposes where the series is not in pixels.
    baseline_frames : float
        The baseline is the mean over so many frames on either side of the minimum.
    search_frames : float
        How far from the minimum the onset and the end are looked for.
    minimum_depth : float
        Least depth of a blink as part of the eye's opening; smaller dips are twitches and noise.
    minimum_tolerance : float
        Frames this close to the lowest one, as part of the amplitude, may be the minimum; 0: only the lowest.
    """

    filter_frames: float = 10
    gradient_frames: float = 20
    gradient_peak: float | None = 0.035
    gradient_opening: float | None = None
    gradient_px: float | None = None
    opening_px: float = 60.0
    baseline_frames: float = 100
    search_frames: float = 300
    minimum_depth: float = 0.23
    minimum_tolerance: float = 0.01

    def __post_init__(self) -> None:
        # Two of the three are None where exactly one is given.
        if [self.gradient_peak, self.gradient_opening, self.gradient_px].count(None) != 2:
            raise InputError(
                "use only one gradient limit: as a fraction of the peak, of the opening, or in pixels per "
                "frame"
            )
        for name, value in vars(self).items():
            least = "0 or more" if name == "minimum_tolerance" else "greater than 0"
            # Written so that NaN is refused as well.
            if value is not None and not (value > 0 or (value == 0 and least == "0 or more")):
                raise InputError(f"{name.replace('_', '-')} must be {least}, got {value:g}")
        for name in ("gradient_peak", "minimum_depth", "minimum_tolerance"):
            value = getattr(self, name)
            if value is not None and value >= 1:
                raise InputError(f"{name.replace('_', '-')} must be a fraction below 1, got {value:g}")


DEFAULT_OPTIONS = LabelOptions()
PRESETS = MappingProxyType(
    {
        "velocity": DEFAULT_OPTIONS,
        "relative": LabelOptions(
            gradient_frames=10, gradient_peak=None, gradient_opening=0.001, minimum_tolerance=0
        ),
        "paper": LabelOptions(gradient_frames=10, gradient_peak=None, gradient_px=0.1, minimum_tolerance=0),
    }
)


def preset(name: str) -> LabelOptions:
    """Return the named set of values: "velocity", "relative" or "paper" (0.1 px per frame)."""
    if name not in PRESETS:
        raise InputError(f"unknown preset '{name}'{did_you_mean(name, [*PRESETS, 'classifier'])}")
    return PRESETS[name]


# Where a blink turns: the frame of its minimum, estimated from its flanks where the bottom is flat.

FLANK = (0.1, 0.5)
"""Parts of the amplitude, from the bottom, between which a flank is steep: they say when the lid turned."""


def turning_frame(smooth: Array, onset: int, lowest: int, end: int, tolerance: float) -> int:
    r"""Frame between onset and end at which closing turns to opening.

    A lid lingers where it turns: noise of a hundredth of the amplitude decides which frame is lowest, and
    the filter moves it toward the slower flank. So frames within `tolerance` of the lowest (as part of the
    amplitude) count alike, and of these the one is taken that parts the bottom as the flanks are steep:

    .. math:: t = t_c + (t_o - t_c) \, T_c / (T_c + T_o) \tag{1}

    t_c and t_o are where closing and opening pass the lower level of FLANK, T_c and T_o how long each takes
    from one level to the other.

    Parameters
    ----------
    smooth : (n,) array
        Filtered distance.
    lowest : int
        Frame of its least value; returned as it is with a tolerance of 0, or where a flank is missing.
    """
    open_level = float(np.interp(lowest, [onset, end], [smooth[onset], smooth[end]]))
    amplitude = open_level - float(smooth[lowest])
    if tolerance == 0 or amplitude <= 0:
        return lowest
    # Both flanks run away from the bottom.
    sides = (smooth[onset : lowest + 1][::-1], smooth[lowest : end + 1])
    reach = np.array([[_first_above(side, smooth[lowest] + p * amplitude) for p in FLANK] for side in sides])
    # A blink that begins or ends half shut has only one flank.
    if not np.isfinite(reach).all():
        return lowest
    closing, opening = np.diff(reach, axis=1)[:, 0]
    # Equation (1), with t_c and t_o counted from the lowest frame.
    turn = lowest - reach[0, 0] + reach[:, 0].sum() * closing / (closing + opening)
    alike = np.arange(int(np.ceil(lowest - reach[0, 0])), int(lowest + reach[1, 0]) + 1)
    alike = alike[smooth[alike] <= smooth[lowest] + tolerance * amplitude]
    return int(alike[np.argmin(np.abs(alike - turn))])


def _first_above(values: Array, level: float) -> float:
    """Place, between frames, where `values` first rises through a level; NaN where it does not."""
    above = np.flatnonzero(values > level)
    # Already above at its first value: there is no passage to find.
    if not above.size or above[0] == 0:
        return float("nan")
    after = int(above[0])
    return after - 1 + float((level - values[after - 1]) / (values[after] - values[after - 1]))


Frames = NDArray[np.intp]


@dataclass(frozen=True)
class LabelledBlink:
    """A blink in a series; onset, minimum and end are frames of the series.

    `depth` is the fall from the local opening to the minimum, as part of that opening; `baseline` the
    paper's mean about the minimum; `touches_neighbour` says that an end of the blink is the highest
    point between it and the next one, which began before the eye had come to rest. `event` is the
    classifier's event with times between frames; None with the paper's rule.
    """

    onset: int
    minimum: int
    end: int
    depth: float
    baseline: float
    touches_neighbour: bool = False
    event: LidEvent | None = None


@dataclass(frozen=True)
class RefusedMinimum:
    """A minimum deep enough for a blink that could not be labeled, and why."""

    minimum: int
    reason: str


def label_blinks(
    distance: Array, fps: float, options: LabelOptions = DEFAULT_OPTIONS, *, is_px: bool = True
) -> list[LabelledBlink]:
    """Label the blinks of a distance series; see `find_blinks` for the minima that were refused."""
    return find_blinks(distance, fps, options, is_px=is_px)[0]


def find_blinks(
    distance: Array, fps: float, options: LabelOptions = DEFAULT_OPTIONS, *, is_px: bool = True
) -> tuple[list[LabelledBlink], list[RefusedMinimum]]:
    """Label the blinks of a distance series.

    Parameters
    ----------
    distance : (n,) array
        Inter-eyelid distance; NaN where it is not known: each piece between is labeled by itself.
    fps : float
        Rate of the series.
    is_px : bool
        Whether the distance is in pixels, which matters where the gradient limit is.

    Returns
    -------
    blinks, refused
        Both in order of time.
    """
    blinks: list[LabelledBlink] = []
    refused: list[RefusedMinimum] = []
    for start, stop in runs(np.isfinite(distance)):
        # Shorter pieces have no frame whose filter and gradient are both whole.
        if stop - start > scaled_frames(options.gradient_frames + options.filter_frames, fps) + 2:
            piece = _Piece(distance[start:stop], fps, options, is_px=is_px)
            labelled, lost = piece.label(offset=start)
            blinks += labelled
            refused += lost
    return blinks, refused


class _Piece:
    """A gapless piece of a series with what the rule needs of it."""

    def __init__(self, distance: Array, fps: float, options: LabelOptions, *, is_px: bool) -> None:
        self.smooth = box_filter(distance, scaled_frames(options.filter_frames, fps))
        self.opening = _local_opening(self.smooth, round(scaled_frames(options.search_frames, fps)))
        # Smoothed twice: noise of single frames would never look like rest.
        gradient = box_filter(np.gradient(self.smooth), scaled_frames(options.gradient_frames, fps))
        # Per frame of 300 fps, as the limits are.
        self.steps = np.abs(gradient) * (fps / PAPER_FPS)
        self.options, self.is_px = options, is_px
        self.half_window = round(scaled_frames(options.gradient_frames, fps) / 2)
        self.baseline_reach = round(scaled_frames(options.baseline_frames, fps))
        self.search_reach = round(scaled_frames(options.search_frames, fps))

    def label(self, offset: int) -> tuple[list[LabelledBlink], list[RefusedMinimum]]:
        minima, tolerance = self._minima(), self.options.minimum_tolerance
        blinks: list[LabelledBlink] = []
        refused: list[RefusedMinimum] = []
        for index, minimum in enumerate(minima):
            # Edges are looked for up to the next minimum on either side.
            before = minima[index - 1] if index else None
            after = minima[index + 1] if index + 1 < len(minima) else None
            baseline = self._baseline(minimum)
            onset, onset_touches = self._edge(minimum, before, baseline, step=-1)
            end, end_touches = self._edge(minimum, after, baseline, step=1)
            # The recording or the search ends before the eye rests.
            if onset is None or end is None:
                side = "before" if onset is None else "after"
                refused.append(RefusedMinimum(minimum + offset, f"the eye does not come to rest {side} it"))
                continue
            blinks.append(
                LabelledBlink(
                    onset=onset + offset,
                    minimum=turning_frame(self.smooth, onset, minimum, end, tolerance) + offset,
                    end=end + offset,
                    depth=float(1 - self.smooth[minimum] / self.opening[minimum]),
                    baseline=baseline,
                    touches_neighbour=onset_touches or end_touches,
                )
            )
        return blinks, refused

    def _minima(self) -> list[int]:
        """Minima at least `minimum_depth` of the local opening deep, and no mere ripple of a deeper one."""
        relative = self.smooth / self.opening
        depth = self.options.minimum_depth
        # Minima are peaks of -r, and -r >= depth - 1 says that r has fallen by `depth`.
        # Half the depth as prominence: a ripple at the bottom is not a second blink.
        minima, _ = find_peaks(-relative, height=depth - 1, prominence=depth / 2)
        return [int(minimum) for minimum in minima]

    def _baseline(self, minimum: int) -> float:
        first = max(0, minimum - self.baseline_reach)
        # Blinks are part of the mean, as in the paper: rest lies above it.
        return float(self.smooth[first : minimum + self.baseline_reach + 1].mean())

    def _edge(
        self, minimum: int, neighbour: int | None, baseline: float, step: int
    ) -> tuple[int | None, bool]:
        """First frame from the minimum on that is quiet and above the baseline, and whether it had to be
        the highest one before a neighboring blink.

        The window of the gradient lies on the frame's far side from the minimum: the eye was at rest just
        before the onset and is at rest just after the end. A centered window would reach into the blink and
        find the onset half a window early.
        """
        limit = minimum + step * self.search_reach
        frames = np.arange(minimum + step, min(max(limit, 0), self.smooth.size - 1) + step, step)
        windows = np.clip(frames + step * self.half_window, 0, self.smooth.size - 1)
        quiet = self.steps[windows] < self._gradient_limit(frames, windows, neighbour)
        met = frames[quiet & (self.smooth[frames] > baseline)]
        reached = int(met[0]) if met.size else None
        if neighbour is None or abs(neighbour - minimum) > self.search_reach:
            return reached, False
        if reached is not None and abs(reached - minimum) < abs(neighbour - minimum):
            return reached, False
        # Not at rest before the neighbor: the blinks meet where the eye is widest.
        between = np.arange(minimum + step, neighbour, step)
        return int(between[np.argmax(self.smooth[between])]), True

    def _gradient_limit(self, frames: Frames, windows: Frames, neighbour: int | None) -> Array | float:
        """Gradient at rest, per 300 fps frame; `frames` lead away from the minimum, `windows` are theirs."""
        options = self.options
        if options.gradient_peak is not None:
            between = frames.size if neighbour is None else abs(neighbour - int(frames[0]))
            # Not beyond the neighbor, whose faster phase would raise the limit.
            phase = frames[: max(1, min(between, self.baseline_reach))]
            return options.gradient_peak * float(self.steps[phase].max())
        if options.gradient_opening is not None:
            return options.gradient_opening * self.opening[windows]
        limit_px = float(options.gradient_px or 0.0)
        # A series in other units is taken as if its opening had so many pixels.
        return limit_px if self.is_px else limit_px / options.opening_px * self.opening[windows]


def _local_opening(smooth: Array, reach: int) -> Array:
    """Opening of the eye about each frame: the 90th percentile over `reach` frames on either side.

    It follows a head that comes nearer; taken on every eighth frame at most, which is enough for it.
    """
    stride = max(1, min(8, reach // 20))
    coarse = percentile_filter(smooth[::stride], 90, size=2 * (reach // stride) + 1, mode="nearest")
    opening = np.interp(np.arange(smooth.size), np.arange(coarse.size) * stride, coarse)
    # An opening of 0 would divide by zero.
    return np.maximum(opening, 1e-9)
