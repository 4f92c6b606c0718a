"""Which eyes are covered, told by a detector that draws lids wherever it looks.

What it draws on a hand or a cloth must not train a model, which would then fit covers as well as eyes.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from experiments.errors import InputError

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_SPREAD = 0.055
"""Contour spread below which an eye is seen in any recording."""
UNUSUAL = 2.0
"""Contour spread of a cover, in lower quartiles of the recording's: an eye in a poor picture is read less
steadily than in a sharp one, and covers may be there for most of the time."""
BESIDE = 0.75
"""Part of the limit above which a look belongs to a cover that looks beside it show: some textures are read
nearly as steadily, at times, as an eye that blinks."""
COVERED = "{} covered: lids are drawn wherever one is looked for"
NAMES = {(True,): "eye", (True, False): "left eye", (False, True): "right eye", (True, True): "both eyes"}


def covered_frames(path: Path, spreads: Mapping[int, Sequence[float]], fewest: int) -> dict[int, str]:
    """Frames that show a covered eye, and that in words.

    Parameters
    ----------
    path : Path
        Of the video, for the message.
    spreads : dict of int to sequence of float
        Frame that shows eyes -> `contour_spread` of each, as part of its width.

    Raises
    ------
    InputError
        Fewer than `fewest` of them show all eyes.
    """
    numbers = sorted(spreads)
    flags = covered(np.array([spreads[n] for n in numbers]))
    covers = {
        n: COVERED.format(NAMES[tuple(f)]) for n, f in zip(numbers, flags.tolist(), strict=True) if any(f)
    }
    if len(numbers) - len(covers) < fewest:
        raise InputError(
            f"{path}: an eye is covered on {len(covers)} of {len(numbers)} frames that show one, "
            "too few are left to track without labels; label frames by hand (--labels)"
        )
    return covers


def covered(spreads: Values) -> Flags:
    """Which eye is covered at which look.

    Parameters
    ----------
    spreads : float64 array (looks, eyes)

    Returns
    -------
    bool array (looks, eyes)
    """
    limits = np.maximum(LEAST_SPREAD, UNUSUAL * np.percentile(spreads, 25, axis=0))
    return np.stack([_told(one, limit) for one, limit in zip(spreads.T, limits, strict=True)], axis=1)


def _told(spreads: Values, limit: float) -> Flags:
    """At which looks (looks,) one eye is covered: runs of spreads near the limit, one of them above it."""
    runs, _ = ndimage.label(spreads > BESIDE * limit)
    return np.isin(runs, np.unique(runs[spreads > limit]))
