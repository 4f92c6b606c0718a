"""Programs that look at a check's clip as it is delivered: single pictures, their mean, and optical flow."""

import io
from collections.abc import Callable

import av
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, laplace, uniform_filter

from stimuli_builder.checks.jobs import DOT_PX, JITTER, LATTICE, CheckJob, digit, shape

Picture = NDArray[np.float64]


def decoded(content: bytes) -> NDArray[np.float64]:
    """(frames, height, width) luma of a clip as a browser decodes it."""
    with av.open(io.BytesIO(content)) as container:
        frames = [frame.to_ndarray(format="yuv420p")[: frame.height] for frame in container.decode(video=0)]
    return np.stack(frames).astype(float)


def local_mean(picture: Picture) -> Picture:
    return uniform_filter(picture, 9 * DOT_PX)


def local_contrast(picture: Picture) -> Picture:
    mean = uniform_filter(picture, 9 * DOT_PX)
    return uniform_filter(picture**2, 9 * DOT_PX) - mean**2


def edges(picture: Picture) -> Picture:
    """Energy of differences between neighbours, over a dot."""
    down, across = np.gradient(gaussian_filter(picture, DOT_PX / 2))
    return uniform_filter(down**2 + across**2, 3 * DOT_PX)


def fine_detail(picture: Picture) -> Picture:
    """Energy above the frequency of the dots: what coding leaves."""
    return uniform_filter(laplace(picture) ** 2, 5 * DOT_PX)


def coding_noise(picture: Picture) -> Picture:
    """Distance from the mean of each dot's 4 x 4 pixels: exact levels were coded, others came back."""
    dots = picture.reshape(LATTICE, DOT_PX, LATTICE, DOT_PX)
    off = abs(dots - dots.mean((1, 3), keepdims=True)).reshape(picture.shape)
    return uniform_filter(off, 5 * DOT_PX)


def off_level(picture: Picture) -> Picture:
    """Distance of each pixel from the nearer of the two levels that were drawn."""
    high, low = picture[picture > 126].mean(), picture[picture <= 126].mean()
    return uniform_filter(np.minimum(abs(picture - high), abs(picture - low)), 5 * DOT_PX)


def horizontal_detail(picture: Picture) -> Picture:
    """Whether neighbours alike lie rather across or down: a streak of coding or of motion."""
    down, across = np.gradient(picture)
    return uniform_filter(across**2 - down**2, 7 * DOT_PX)


LOOKS: dict[str, Callable[[Picture], Picture]] = {
    look.__name__: look
    for look in (
        local_mean,
        local_contrast,
        edges,
        fine_detail,
        coding_noise,
        off_level,
        horizontal_detail,
    )
}


def ranks(score: Picture) -> Picture:
    """Ranks of every second pixel in both directions, ties halved."""
    _, place, counts = np.unique(score[::2, ::2].round(9), return_inverse=True, return_counts=True)
    ranked: Picture = (np.cumsum(counts) - (counts - 1) / 2)[place]
    return ranked


def area_under_curve(ranked: Picture, mask: NDArray[np.bool_]) -> float:
    """Probability that a pixel inside the mask scores above one outside it (Mann-Whitney U)."""
    inside = mask[::2, ::2]
    n = int(inside.sum())
    return float((ranked[inside].sum() - n * (n + 1) / 2) / (n * (inside.size - n)))


def flow_fields(clip: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evidence of motion left, right, up and down by a dot a frame, at each dot: a mean over all frames.

    The dot before a step, moved, against the dot after it: a Reichardt correlator on the lattice.
    """
    dots = clip.reshape(len(clip), LATTICE, DOT_PX, LATTICE, DOT_PX).mean((2, 4)) - clip.mean()
    fields = []
    for axis, sign in ((2, -1), (2, 1), (1, -1), (1, 1)):
        same = np.roll(dots[:-1], sign, axis) * dots[1:]
        fields.append(same.mean(0))
    return np.stack(fields)


def answer_by_flow(job: CheckJob, clip: NDArray[np.float64]) -> int:
    """The answer of a program that computes optical flow and knows what may be shown."""
    fields = flow_fields(clip)
    if job.check == "direction":
        return int(fields.mean((1, 2)).argmax()) + 1
    axis = int(abs(fields[0] - fields[1]).mean() < abs(fields[2] - fields[3]).mean())
    return best_template(job, uniform_filter(fields[2 * axis] - fields[2 * axis + 1], 3))


def best_template(job: CheckJob, field: Picture) -> int:
    """The answer whose mask, at its best place and with either sign, correlates most with a field of dots."""
    draw, answers = (digit, 9) if job.check == "digit" else (shape, 4)
    best = {}
    for answer in range(1, answers + 1):
        shown = draw(answer)
        scores = []
        for down in range(-JITTER, JITTER + 1):
            for across in range(-JITTER, JITTER + 1):
                mask = np.zeros((LATTICE, LATTICE))
                top, left = ((LATTICE - side) // 2 for side in shown.shape)
                mask[
                    top + down : top + down + shown.shape[0], left + across : left + across + shown.shape[1]
                ] = shown
                scores.append(abs(np.corrcoef(mask.ravel(), field.ravel())[0, 1]))
        best[answer] = max(scores)
    return max(best, key=lambda answer: best[answer])


def on_lattice(picture: Picture) -> Picture:
    """The mean of each dot's pixels."""
    return picture.reshape(LATTICE, DOT_PX, LATTICE, DOT_PX).mean((1, 3))
