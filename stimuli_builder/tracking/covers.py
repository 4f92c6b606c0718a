"""Which eyes are covered: lids follow the region they are read in, and what surrounds them is not as usual.

What a detector draws on a hand or a cloth must not train a model, which would then fit covers as eyes.
An eye that is shut, pressed shut or turned away is read unsteadily too; but brow, cheek and nose still lie
around it, which a hand, a sheet or a bar over the eye hides.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, eye_axis
from stimuli_builder.video import Picture

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]
Looks = NDArray[np.float32]

LEAST_SPREAD, MAX_SPREAD = 0.055, 0.10
"""Contour spreads below which an eye is seen in any recording, and above which none is."""
UNUSUAL = 2.0
"""Contour spread of a cover, in lower quartiles of the recording's: an eye in a poor picture is read less
steadily than in a sharp one, and covers may be there for most of the time."""
BESIDE = 0.75
"""Part of the limit above which a look belongs to a cover that the look before or after it shows: some
textures are read nearly as steadily, at times, as an eye that blinks."""
STEADY = 0.75
"""Part of the least limit up to which a look certainly shows the eye, and its surroundings are its own."""
FAMILIAR, ALIKE = (0.78, 0.90), 0.90
"""Correlation with the surroundings of steady looks from which on an eye is not covered, at the spreads of
UNSTEADIER; and next to a covered look. Shut eyes have 0.88 or more, squinting ones 0.79 to 0.84; it is 0.4 or
less under a hand, 0.74 or less under a narrow bar, and 0.55 to 0.85 where a hand or a cheek comes in."""
UNSTEADIER = (0.065, 0.09)
"""Spreads, hardly more than a shut eye's and as a hand's, between which the correlation needed rises."""
FELLOW = 1.25
"""Spread of the other eye, in its lower quartiles, from which on it moved too: eyes shut and turn together.
A small thing over one eye, with familiar surroundings, leaves the other as it was."""
WITNESSES = 5
"""So many steady looks must be as familiar: one alone may show a cover as it comes in."""
RING_WIDE, RING_HIGH = 0.68, 0.42
"""Half the width and height of the ellipse that lids move in, in eye's widths: surroundings lie outside."""
ACROSS, DOWN = np.linspace(-1.0, 1.0, 33), np.linspace(-0.9, 0.9, 29)
RING = np.array([(x, y) for y in DOWN for x in ACROSS if np.hypot(x / RING_WIDE, y / RING_HIGH) > 1])
"""Where an eye's surroundings are looked at, from the middle of its canthi, in its widths."""
SMOOTHED = 0.03
"""Blur of the surroundings in eye's widths, so that noise and single lashes count little."""
IN_PICTURE = 0.4
"""Part of the surroundings that two looks must both show to be compared."""
COVERED = "{} covered: lids are not read steadily; what surrounds them and the other eye do not say shut"
UNSTEADY = "{} covered, shut tightly or turned away: its lids are not read steadily"
"""What an unsteady contour can mean in a recording without steady looks to compare its surroundings with."""
NAMES = {(True,): "eye", (True, False): "left eye", (False, True): "right eye", (True, True): "both eyes"}


def covered_frames(
    path: Path,
    spreads: Mapping[int, Sequence[float]],
    fewest: int,
    surroundings: Mapping[int, Looks] | None = None,
) -> dict[int, str]:
    """Frames that show a covered eye, and that in words.

    Parameters
    ----------
    path : Path
        Of the video, for the message.
    spreads : dict of int to sequence of float
        Frame that shows eyes -> `contour_spread` of each, as part of its width.
    fewest : int
        Frames without a cover that are needed.
    surroundings : dict of int to float32 array (eyes, cells), optional
        Frame -> `surroundings_of` its eyes; without them every unsteady eye is covered.

    Returns
    -------
    dict of int to str
        Frame -> which eyes are covered, and why.

    Raises
    ------
    InputError
        Fewer than `fewest` of them show all eyes.
    """
    numbers = sorted(spreads)
    looks = None if surroundings is None else np.array([surroundings[n] for n in numbers])
    of_eyes = np.array([spreads[n] for n in numbers])
    flags = covered(of_eyes, np.array(numbers), looks)
    compared = (_steady(of_eyes).sum(0) >= WITNESSES) & (looks is not None)
    covers = {
        n: (COVERED if compared[flag].all() else UNSTEADY).format(NAMES[tuple(flag.tolist())])
        for n, flag in zip(numbers, flags, strict=True)
        if flag.any()
    }
    if len(numbers) - len(covers) < fewest:
        raise InputError(
            f"{path}: an eye is covered on {len(covers)} of {len(numbers)} frames that show one, "
            "too few are left to track without labels; label frames by hand (--labels)"
        )
    return covers


def covered(spreads: Values, numbers: NDArray[np.int64], surroundings: Looks | None = None) -> Flags:
    """Which eye is covered at which look.

    Parameters
    ----------
    spreads : float64 array (looks, eyes)
        Of each eye, as part of its width.
    numbers : int64 array (looks,)
        Of their frames, ascending.
    surroundings : float32 array (looks, eyes, cells), optional
        See `surroundings_of`.

    Returns
    -------
    bool array (looks, eyes)
    """
    limits = np.clip(UNUSUAL * np.percentile(spreads, 25, axis=0), LEAST_SPREAD, MAX_SPREAD)
    alike = _likeness_to_steady(spreads, BESIDE * limits, surroundings)
    above = (spreads > limits) & (alike < np.interp(spreads, UNSTEADIER, FAMILIAR))
    # Looks with others between them that show no eyes are not beside one another.
    steps = np.diff(numbers)
    neighbours = (steps <= steps.min(initial=numbers[-1] + 1))[:, None]
    beside = np.zeros_like(above)
    beside[1:] |= above[:-1] & neighbours
    beside[:-1] |= above[1:] & neighbours
    return np.asarray(above | (beside & (spreads > BESIDE * limits) & (alike < ALIKE)))


def _steady(spreads: Values) -> Flags:
    """Which looks certainly show the eye."""
    return np.asarray(spreads <= STEADY * LEAST_SPREAD)


def _likeness_to_steady(spreads: Values, least: Values, surroundings: Looks | None) -> Values:
    """How like steady looks' the surroundings of eyes are whose spread is above `least` (looks, eyes).

    -1 where the recording has too few steady looks to tell, or the other eye is as steady as ever.
    """
    alike = np.full(spreads.shape, -1.0)
    if surroundings is None:
        return alike
    unsteady = spreads > FELLOW * np.percentile(spreads, 25, axis=0)
    for eye in range(spreads.shape[1]):
        steady = surroundings[_steady(spreads)[:, eye], eye]
        if len(steady) >= WITNESSES:
            for look in np.flatnonzero((spreads[:, eye] > least[eye]) & unsteady.all(1)):
                alike[look, eye] = np.sort(likenesses(surroundings[look, eye], steady))[-WITNESSES]
    return alike


def likenesses(one: Looks, others: Looks) -> Values:
    """Correlation of one look's surroundings (cells,) with others' (looks, cells), over what both show.

    0 where both show less than 40% of the cells, or one of them is even.
    """
    known = np.isfinite(one) & np.isfinite(others)
    count = np.maximum(known.sum(1), 1)
    first, second = (np.where(known, values, 0.0) for values in (one, others))
    first = np.where(known, first - (first.sum(1) / count)[:, None], 0.0)
    second = np.where(known, second - (second.sum(1) / count)[:, None], 0.0)
    norm = np.sqrt((first**2).sum(1) * (second**2).sum(1))
    enough = (count >= IN_PICTURE * known.shape[1]) & (norm > 0)
    return np.where(enough, (first * second).sum(1) / np.maximum(norm, 1e-9), 0.0)


def surroundings_of(picture: Picture, points: Points) -> Looks:
    """Grey levels around each eye, free of its place, size and turn; NaN beyond the picture.

    Parameters
    ----------
    picture : uint8 array (h, w, 3)
        RGB.
    points : float64 array (9 * eyes, 2)
        In pixels.

    Returns
    -------
    float32 array (eyes, cells)
    """
    looks = []
    for eye in points.reshape(-1, EYE_POINTS, 2):
        along, down, width = eye_axis(eye)
        at = (eye[0] + eye[5]) / 2 + width * (RING[:, :1] * along + RING[:, 1:] * down)
        last = np.array(picture.shape[1::-1]) - 1
        left, top = np.clip(np.floor(at.min(0)), 0, last).astype(int)
        right, bottom = np.clip(np.ceil(at.max(0)), 0, last).astype(int)
        grey = cv2.cvtColor(
            np.ascontiguousarray(picture[top : bottom + 1, left : right + 1]), cv2.COLOR_RGB2GRAY
        )
        smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), max(0.5, SMOOTHED * width))
        inside = ((at >= 0) & (at <= last)).all(1)
        x, y = (at - [left, top]).astype(np.float32).T
        levels = cv2.remap(smooth, x[None], y[None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
        looks.append(np.where(inside, levels, np.nan).astype(np.float32))
    return np.array(looks)
