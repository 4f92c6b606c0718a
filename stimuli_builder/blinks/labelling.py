"""Find the blinks of a distance series: onset, minimum and end by the paper's two criteria (3.3.1)."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import percentile_filter
from scipy.signal import find_peaks

from experiments.errors import InputError, did_you_mean
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import box_filter, runs, scaled_frames


@dataclass(frozen=True)
class LabelOptions:
    """Values of the labelling rule; all frame counts are the paper's, at 300 fps, and scale with the rate.

    Parameters
    ----------
    filter_frames : float
        Width of the zero-phase filter.
    gradient_frames : float
        Window over which the gradient is averaged.
    gradient_opening : float or None
        Largest averaged gradient at onset and end, as part of the eye's opening per 300 fps frame.
    gradient_px : float or None
        The same in pixels per 300 fps frame (the paper's 0.1); takes the place of `gradient_opening`.
    opening_px : float
        Opening of the eye in pixels that `gradient_px` supposes where the series is not in pixels.
    baseline_frames : float
        The baseline is the mean over so many frames on either side of the minimum.
    search_frames : float
        How far from the minimum the onset and the end are looked for.
    minimum_depth : float
        Least depth of a blink as part of the eye's opening; smaller dips are twitches and noise.
    """

    filter_frames: float = 10
    gradient_frames: float = 10
    gradient_opening: float | None = 0.001
    gradient_px: float | None = None
    opening_px: float = 60.0
    baseline_frames: float = 100
    search_frames: float = 300
    minimum_depth: float = 0.23

    def __post_init__(self) -> None:
        if (self.gradient_opening is None) == (self.gradient_px is None):
            raise InputError("give the gradient limit either relative to the opening or in pixels, not both")
        for name, value in vars(self).items():
            if value is not None and not value > 0:
                raise InputError(f"{name.replace('_', '-')} must be greater than 0, got {value:g}")
        if self.minimum_depth >= 1:
            raise InputError(f"minimum-depth is a part of the opening, below 1, got {self.minimum_depth:g}")


DEFAULT_OPTIONS = LabelOptions()
PRESETS = MappingProxyType(
    {
        "relative": DEFAULT_OPTIONS,
        "paper": LabelOptions(gradient_opening=None, gradient_px=0.1),
    }
)


def preset(name: str) -> LabelOptions:
    """Return the named set of values: "relative" (the default) or "paper" (0.1 px per frame)."""
    if name not in PRESETS:
        raise InputError(f"unknown preset '{name}'{did_you_mean(name, PRESETS)}")
    return PRESETS[name]


@dataclass(frozen=True)
class LabelledBlink:
    """A blink in a series; onset, minimum and end are frames of the series.

    `depth` is the fall from the local opening to the minimum, as part of that opening; `baseline` the
    paper's mean about the minimum; `touches_neighbour` says that an end of the blink is the highest
    point between it and the next one, which began before the eye had come to rest.
    """

    onset: int
    minimum: int
    end: int
    depth: float
    baseline: float
    touches_neighbour: bool = False


@dataclass(frozen=True)
class RefusedMinimum:
    """A minimum deep enough for a blink that could not be labelled, and why."""

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
        Inter-eyelid distance; NaN where it is not known: each piece between is labelled by itself.
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
        if stop - start > scaled_frames(options.gradient_frames + options.filter_frames, fps) + 2:
            piece = _Piece(distance[start:stop], fps, options, is_px=is_px)
            found, lost = piece.label(offset=start)
            blinks += found
            refused += lost
    return blinks, refused


class _Piece:
    """A gapless piece of a series with what the rule needs of it."""

    def __init__(self, distance: Array, fps: float, options: LabelOptions, *, is_px: bool) -> None:
        self.smooth = box_filter(distance, scaled_frames(options.filter_frames, fps))
        self.opening = _local_opening(self.smooth, round(scaled_frames(options.search_frames, fps)))
        steps = np.abs(box_filter(np.gradient(self.smooth), scaled_frames(options.gradient_frames, fps)))
        self.quiet = steps < _gradient_limit(self.opening, options, is_px=is_px) * (300 / fps)
        self.half_window = round(scaled_frames(options.gradient_frames, fps) / 2)
        self.baseline_reach = round(scaled_frames(options.baseline_frames, fps))
        self.search_reach = round(scaled_frames(options.search_frames, fps))
        self.minimum_depth = options.minimum_depth

    def label(self, offset: int) -> tuple[list[LabelledBlink], list[RefusedMinimum]]:
        minima = self._minima()
        blinks: list[LabelledBlink] = []
        refused: list[RefusedMinimum] = []
        for index, minimum in enumerate(minima):
            before = minima[index - 1] if index else None
            after = minima[index + 1] if index + 1 < len(minima) else None
            baseline = self._baseline(minimum)
            onset, onset_touches = self._edge(minimum, before, baseline, step=-1)
            end, end_touches = self._edge(minimum, after, baseline, step=1)
            if onset is None or end is None:
                side = "before" if onset is None else "after"
                refused.append(RefusedMinimum(minimum + offset, f"the eye does not come to rest {side} it"))
                continue
            blinks.append(
                LabelledBlink(
                    onset=onset + offset,
                    minimum=minimum + offset,
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
        found, _ = find_peaks(-relative, height=self.minimum_depth - 1, prominence=self.minimum_depth / 2)
        return [int(minimum) for minimum in found]

    def _baseline(self, minimum: int) -> float:
        first = max(0, minimum - self.baseline_reach)
        return float(self.smooth[first : minimum + self.baseline_reach + 1].mean())

    def _edge(
        self, minimum: int, neighbour: int | None, baseline: float, step: int
    ) -> tuple[int | None, bool]:
        """First frame from the minimum on that is quiet and above the baseline, and whether it had to be
        the highest one before a neighbouring blink.

        The window of the gradient lies on the frame's far side from the minimum: the eye was at rest just
        before the onset and is at rest just after the end. A centred window would reach into the blink and
        find the onset half a window early.
        """
        limit = minimum + step * self.search_reach
        frames = np.arange(minimum + step, min(max(limit, 0), self.smooth.size - 1) + step, step)
        windows = np.clip(frames + step * self.half_window, 0, self.smooth.size - 1)
        met = frames[self.quiet[windows] & (self.smooth[frames] > baseline)]
        reached = int(met[0]) if met.size else None
        if neighbour is None or abs(neighbour - minimum) > self.search_reach:
            return reached, False
        if reached is not None and abs(reached - minimum) < abs(neighbour - minimum):
            return reached, False
        between = np.arange(minimum + step, neighbour, step)
        return int(between[np.argmax(self.smooth[between])]), True


def _local_opening(smooth: Array, reach: int) -> Array:
    """Opening of the eye about each frame: the 90th percentile over `reach` frames on either side.

    It follows a head that comes nearer; taken on every eighth frame at most, which is enough for it.
    """
    stride = max(1, min(8, reach // 20))
    coarse = percentile_filter(smooth[::stride], 90, size=2 * (reach // stride) + 1, mode="nearest")
    opening = np.interp(np.arange(smooth.size), np.arange(coarse.size) * stride, coarse)
    return np.maximum(opening, 1e-9)


def _gradient_limit(opening: Array, options: LabelOptions, *, is_px: bool) -> Array | NDArray[np.float64]:
    if options.gradient_opening is not None:
        return options.gradient_opening * opening
    limit_px = float(options.gradient_px or 0.0)
    return np.full(opening.size, limit_px) if is_px else limit_px / options.opening_px * opening
