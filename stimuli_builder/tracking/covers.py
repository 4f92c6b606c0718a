"""Which eyes are covered, told by a detector that draws lids wherever it looks.

What it draws on a hand or a cloth must not train a model, which would then fit covers as well as eyes.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_SPREAD, MAX_SPREAD = 0.055, 0.10
"""Contour spreads below which an eye is seen in any recording, and above which none is."""
UNUSUAL = 2.0
"""Contour spread of a cover, in lower quartiles of the recording's: an eye in a poor picture is read less
steadily than in a sharp one, and covers may be there for most of the time."""
BESIDE = 0.75
"""Part of the limit above which a look belongs to a cover that the look before or after it shows: some
textures are read nearly as steadily, at times, as an eye that blinks."""
COVERED = "{} covered, shut tightly or turned away: its lids are not read steadily"
"""What an unsteady contour can mean: it tells a hand from neither lids pressed shut nor an averted gaze."""
NAMES = {(True,): "eye", (True, False): "left eye", (False, True): "right eye", (True, True): "both eyes"}


def covered_frames(path: Path, spreads: Mapping[int, Sequence[float]], fewest: int) -> dict[int, str]:
    """Frames that show a covered eye, and that in words.

    Parameters
    ----------
    path : Path
        Of the video, for the message.
    spreads : dict of int to sequence of float
        Frame that shows eyes -> `contour_spread` of each, as part of its width.
    fewest : int
        Frames without a cover that are needed.

    Returns
    -------
    dict of int to str
        Frame -> which eyes are covered, and how that is told.

    Raises
    ------
    InputError
        Fewer than `fewest` of them show all eyes.
    """
    numbers = sorted(spreads)
    flags = covered(np.array([spreads[n] for n in numbers]), np.array(numbers))
    covers = {
        n: COVERED.format(NAMES[tuple(f)]) for n, f in zip(numbers, flags.tolist(), strict=True) if any(f)
    }
    if len(numbers) - len(covers) < fewest:
        raise InputError(
            f"{path}: an eye is covered on {len(covers)} of {len(numbers)} frames that show one, "
            "too few are left to track without labels; label frames by hand (--labels)"
        )
    return covers


def covered(spreads: Values, numbers: NDArray[np.int64]) -> Flags:
    """Which eye is covered at which look.

    Parameters
    ----------
    spreads : float64 array (looks, eyes)
        Of each eye, as part of its width.
    numbers : int64 array (looks,)
        Of their frames, ascending.

    Returns
    -------
    bool array (looks, eyes)
    """
    limits = np.clip(UNUSUAL * np.percentile(spreads, 25, axis=0), LEAST_SPREAD, MAX_SPREAD)
    above = spreads > limits
    # Looks with others between them that show no eyes are not beside one another.
    steps = np.diff(numbers)
    neighbours = (steps <= steps.min(initial=numbers[-1] + 1))[:, None]
    beside = np.zeros_like(above)
    beside[1:] |= above[:-1] & neighbours
    beside[:-1] |= above[1:] & neighbours
    return np.asarray(above | (beside & (spreads > BESIDE * limits)))
