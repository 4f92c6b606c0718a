"""Find the blinks of a distance series: onset, minimum and end by the paper's two criteria (3.3.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import percentile_filter
from scipy.signal import find_peaks

from stimuli_builder.blinks.bottom import turning_frame
from stimuli_builder.blinks.events.lid_event import LidEvent
from stimuli_builder.blinks.gaps import runs
from stimuli_builder.blinks.label_options import DEFAULT_OPTIONS, LabelOptions
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import PAPER_FPS, box_filter, scaled_frames

Frames = NDArray[np.intp]


@dataclass(frozen=True)
class LabelledBlink:
    """A blink in a series; onset, minimum and end are frames of the series.

    `depth` is the fall from the local opening to the minimum, as part of that opening; `baseline` the
    paper's mean about the minimum; `touches_neighbour` says that an end of the blink is the highest
    point between it and the next one, which began before the eye had come to rest. `event` is what the
    classifier of lid events told of it, its times between frames; None by the paper's rule.
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
            labelled, lost = piece.label(offset=start)
            blinks += labelled
            refused += lost
    return blinks, refused


class _Piece:
    """A gapless piece of a series with what the rule needs of it."""

    def __init__(self, distance: Array, fps: float, options: LabelOptions, *, is_px: bool) -> None:
        self.smooth = box_filter(distance, scaled_frames(options.filter_frames, fps))
        self.opening = _local_opening(self.smooth, round(scaled_frames(options.search_frames, fps)))
        gradient = box_filter(np.gradient(self.smooth), scaled_frames(options.gradient_frames, fps))
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
        minima, _ = find_peaks(-relative, height=depth - 1, prominence=depth / 2)
        return [int(minimum) for minimum in minima]

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
        quiet = self.steps[windows] < self._gradient_limit(frames, windows, neighbour)
        met = frames[quiet & (self.smooth[frames] > baseline)]
        reached = int(met[0]) if met.size else None
        if neighbour is None or abs(neighbour - minimum) > self.search_reach:
            return reached, False
        if reached is not None and abs(reached - minimum) < abs(neighbour - minimum):
            return reached, False
        between = np.arange(minimum + step, neighbour, step)
        return int(between[np.argmax(self.smooth[between])]), True

    def _gradient_limit(self, frames: Frames, windows: Frames, neighbour: int | None) -> Array | float:
        """Gradient at rest, per 300 fps frame; `frames` lead away from the minimum, `windows` are theirs."""
        options = self.options
        if options.gradient_peak is not None:
            between = frames.size if neighbour is None else abs(neighbour - int(frames[0]))
            phase = frames[: max(1, min(between, self.baseline_reach))]
            return options.gradient_peak * float(self.steps[phase].max())
        if options.gradient_opening is not None:
            return options.gradient_opening * self.opening[windows]
        limit_px = float(options.gradient_px or 0.0)
        return limit_px if self.is_px else limit_px / options.opening_px * self.opening[windows]


def _local_opening(smooth: Array, reach: int) -> Array:
    """Opening of the eye about each frame: the 90th percentile over `reach` frames on either side.

    It follows a head that comes nearer; taken on every eighth frame at most, which is enough for it.
    """
    stride = max(1, min(8, reach // 20))
    coarse = percentile_filter(smooth[::stride], 90, size=2 * (reach // stride) + 1, mode="nearest")
    opening = np.interp(np.arange(smooth.size), np.arange(coarse.size) * stride, coarse)
    return np.maximum(opening, 1e-9)
