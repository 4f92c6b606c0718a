"""Which samples of a 300 fps signal an output frame shows, and with what weight."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.blinks.profile import PROFILE_FPS

Array = NDArray[np.float64]


def samples_per_frame(fps: float) -> float:
    """Samples at 300 fps in one output frame: 10 at 30 fps, 12.5 at 24 fps."""
    return PROFILE_FPS / fps


def frame_windows(sample_count: int, fps: float, blur: bool) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """Yield for each output frame the samples of a signal that it shows, and their weights, which sum to 1.

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
    for start in np.arange(frames) * step:
        if not blur:
            yield np.array([int(start + step / 2 + 1e-9)]), np.ones(1)
            continue
        sample = np.arange(int(start), min(sample_count, int(np.ceil(start + step)) + 1))
        covered = np.clip(np.minimum(start + step, sample + 1) - np.maximum(start, sample), 0.0, 1.0)
        used = covered > 0
        yield sample[used], covered[used] / covered.sum()


def frame_weights(sample_count: int, fps: float, blur: bool) -> Array:
    """(frames, samples) weights of a short signal's samples, as `frame_windows` gives them one by one."""
    windows = list(frame_windows(sample_count, fps, blur))
    weights = np.zeros((len(windows), sample_count))
    for row, (samples, shares) in zip(weights, windows, strict=True):
        row[samples] = shares
    return weights
