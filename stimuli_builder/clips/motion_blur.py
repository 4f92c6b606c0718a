"""Which samples of a 300 fps signal an output frame shows, and with what weight."""

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.blinks.profile import PROFILE_FPS

Array = NDArray[np.float64]


def samples_per_frame(fps: float) -> float:
    """Samples at 300 fps in one output frame: 10 at 30 fps, 12.5 at 24 fps."""
    return PROFILE_FPS / fps


def frame_weights(sample_count: int, fps: float, blur: bool) -> Array:
    """(frames, samples) weights of a signal's samples in each output frame; every row sums to 1.

    With blur a frame is the mean of the samples inside its time, the paper's average of ten (4.1.1):
    our frame k at 30 fps stands at sample 10 k + 5 and averages 10 k ... 10 k + 9, five before and four
    after. Where a frame's time cuts a sample, the sample counts by its share. Without blur a frame is
    the sample it stands at. The averaging itself must be done in linear light.

    Parameters
    ----------
    sample_count : int
        Length of the signal; frames that do not fit in wholly are left out.
    fps : float
        Rate of the output, 24 to 60.
    """
    step = samples_per_frame(fps)
    frames = int(sample_count / step + 1e-9)
    if frames < 1:
        raise InputError(
            f"{sample_count} samples at {PROFILE_FPS} fps are less than one frame at {fps:g} fps"
        )
    starts = np.arange(frames)[:, None] * step
    if not blur:
        weights = np.zeros((frames, sample_count))
        weights[np.arange(frames), (starts[:, 0] + step / 2 + 1e-9).astype(int)] = 1.0
        return weights
    sample = np.arange(sample_count)[None, :]
    covered = np.minimum(starts + step, sample + 1) - np.maximum(starts, sample)
    covered = np.clip(covered, 0.0, 1.0)
    shares: Array = covered / covered.sum(axis=1, keepdims=True)
    return shares
