"""Depth of a lid series: how far the eye is closed, as part of how far it is open about then."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import percentile_filter

from stimuli_builder.blinks.profile import OPEN_PERCENTILE, Array
from stimuli_builder.blinks.series import box_filter

OPEN_REACH_S = 5.0
LEAST_OPEN = 0.6
"""The local opening is at least this part of the recording's: else a long closed eye would count as open."""
SMOOTHING_S = 0.033
NOISE_FLOOR = 0.004


@dataclass(frozen=True, eq=False)
class Depth:
    """A gapless piece of a series as depth r = 1 - d / opening.

    Parameters
    ----------
    raw, smooth : (n,) arrays
        Depth as measured and after a zero-phase average over 33 ms; 0 open.
    opening : (n,) array
        Opening taken as r = 0, in the unit of the series.
    noise : float
        Standard deviation of `raw` from frame to frame, as depth.
    fps : float
    """

    raw: Array
    smooth: Array
    opening: Array
    noise: float
    fps: float


def depth_of(distance: Array, fps: float) -> Depth:
    """Return the depth of a gapless series (n,), its opening following a head that comes nearer."""
    opening = local_opening(distance, fps)
    raw = 1 - distance / opening
    smooth = box_filter(raw, max(1.0, SMOOTHING_S * fps))
    return Depth(raw, smooth, opening, frame_noise(raw), fps)


def local_opening(distance: Array, fps: float) -> Array:
    """Opening about each frame: the 85th percentile within 5 s, not below 0.6 of the recording's."""
    stride = max(1, int(fps / 10))
    coarse = distance[::stride]
    reach = max(1, round(OPEN_REACH_S * fps / stride))
    level = percentile_filter(coarse, OPEN_PERCENTILE, size=2 * reach + 1, mode="nearest")
    whole = float(np.percentile(coarse, OPEN_PERCENTILE))
    level = np.maximum(level, LEAST_OPEN * whole)
    frames = np.arange(coarse.size) * stride
    return np.maximum(np.interp(np.arange(distance.size), frames, level), 1e-9)


def frame_noise(raw: Array) -> float:
    """Noise of one frame from second differences, which lids moving smoothly hardly touch."""
    if raw.size < 4:
        return NOISE_FLOOR
    second = np.diff(raw, 2)
    spread = float(np.median(np.abs(second - np.median(second))))
    return max(NOISE_FLOOR, 1.4826 * spread / 6**0.5)
