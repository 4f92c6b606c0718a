"""The curve that is exported: closure of both eyes at the frame rate of the animation."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.lower_lid import lower_lid
from stimuli_builder.blinks.profile import Array, BlinkProfile

INTERVAL_MEDIAN_S = 3.4
INTERVAL_LOG_SD = 0.87
REST_S = 0.1
"""Open eye after a blink in which its lagging signals come to rest."""


@dataclass(frozen=True, eq=False)
class AnimationCurve:
    """Closure of the left and right eye at `fps`, and the lower lids' motion in mm.

    `blinks` names each blink with the frame of its onset.
    """

    fps: float
    left: Array
    right: Array
    lower_up_mm: Array
    lower_nasal_mm: Array
    blinks: tuple[tuple[str, float], ...]


def make_curve(
    profiles: Sequence[BlinkProfile], fps: float, lead_s: float = 0.0, seed: int | None = None
) -> AnimationCurve:
    """Put blinks one after another on a curve at `fps`.

    Each blink is laid so that its minimum falls on a frame: else an animation at 30 fps would miss the
    moment of closure. The first begins after `lead_s`; the following ones at natural intervals from
    minimum to minimum, drawn log-normal (median 3.4 s, sd of log 0.87) from `seed`.

    Parameters
    ----------
    profiles : sequence of BlinkProfile
    fps : float
        Frame rate of the curve, 1 to 1000.
    lead_s : float
        Open-eye seconds before the first and after the last blink.
    seed : int, optional
        For the intervals; needed with two or more blinks.
    """
    if not 1 <= fps <= 1000:
        raise InputError(f"the frame rate of a curve must lie between 1 and 1000, got {fps:g}")
    if not 0 <= lead_s <= 3600:
        raise InputError(f"the lead must lie between 0 and 3600 seconds, got {lead_s:g}")
    if not profiles:
        raise InputError("a curve needs one blink or more")
    minima = _minimum_frames(profiles, fps, lead_s, np.random.default_rng(seed))
    last = profiles[-1]
    tail = (last.closure.size - 1 - last.minimum_index) / last.fps + lead_s
    frames = np.arange(minima[-1] + int(np.ceil(tail * fps - 1e-9)) + 1)
    tracks = np.zeros((4, frames.size))
    for profile, minimum in zip(profiles, minima, strict=True):
        # The nasal slide lags the lids: it comes to rest after the blink's last sample.
        up, nasal = lower_lid(profile, _with_rest(profile))
        other = profile.closure if profile.closure_other is None else profile.closure_other
        position = (frames - minimum) * profile.fps / fps + profile.minimum_index
        for track, values in zip(tracks, (profile.closure, other, up, nasal), strict=True):
            # Blinks drawn closer than they last meet at the more closed of the two.
            np.maximum(track, np.interp(position, np.arange(values.size), values, left=0, right=0), out=track)
    onsets = [minimum - p.down_frames / p.fps * fps for p, minimum in zip(profiles, minima, strict=True)]
    names = tuple((p.profile_id, round(onset, 4)) for p, onset in zip(profiles, onsets, strict=True))
    left, right, up, nasal = np.round(tracks, 6)
    return AnimationCurve(fps, left, right, up, nasal, names)


def _with_rest(profile: BlinkProfile) -> Array | None:
    """The closure and the open eye after it; None where the lower lid was measured with the blink."""
    if profile.lower_up_mm is not None:
        return None
    return np.pad(profile.closure, (0, round(REST_S * profile.fps)), mode="edge")


def _minimum_frames(
    profiles: Sequence[BlinkProfile], fps: float, lead_s: float, rng: np.random.Generator
) -> list[int]:
    first = profiles[0]
    frames = [int(np.ceil((lead_s + first.minimum_index / first.fps) * fps - 1e-9))]
    for previous, profile in pairwise(profiles):
        drawn_s = float(rng.lognormal(np.log(INTERVAL_MEDIAN_S), INTERVAL_LOG_SD))
        least_s = (previous.closure.size - previous.minimum_index + profile.minimum_index) / profile.fps
        frames.append(frames[-1] + int(np.ceil(max(drawn_s, least_s) * fps)))
    return frames
