"""The lower lid's motion as a track measured it."""

import numpy as np
import pandas as pd

from stimuli_builder.blinks.profile import Array

FISSURE_LENGTH_MM = 28.2
"""Outer to inner canthus, as on the realistic character; it gives a track its scale."""
_OUTER_CANTHUS, _INNER_CANTHUS, _LOWER_LID = 0, 5, slice(6, 9)


def tracked_lower_lid(table: pd.DataFrame, column: str) -> tuple[Array, Array] | None:
    """Place of the lower lid over a track, in mm, or None where the table has no landmarks of that eye.

    The mean of the three lower-lid points along and across the eye's axis (outer to inner canthus, median
    over the recording). In the picture's frame, not the canthi's: these move in a blink themselves. A
    close-up of one eye does not tell where the nose is: there it is the side the lid slides to.

    Returns
    -------
    up_mm, nasal_mm : (n,) float64 arrays
        From an arbitrary origin; NaN on frames without a fit.
    """
    first = 10 if column == "right_distance_px" else 1
    names = [f"{axis}{point:02d}" for point in range(first, first + 9) for axis in "xy"]
    if not set(names) <= set(table.columns):
        return None
    points = table[names].to_numpy(dtype=np.float64).reshape(-1, 9, 2)
    known = np.isfinite(points).all(axis=(1, 2))
    if not known.any():
        return None
    axis = np.median(points[known, _INNER_CANTHUS] - points[known, _OUTER_CANTHUS], axis=0)
    length_px = float(np.hypot(*axis))
    nasal = axis / max(length_px, 1e-9)
    upwards = np.array([nasal[1], -nasal[0]]) * (1.0 if nasal[0] >= 0 else -1.0)
    lid_mm = points[:, _LOWER_LID].mean(axis=1) * FISSURE_LENGTH_MM / max(length_px, 1e-9)
    up_mm, nasal_mm = lid_mm @ upwards, lid_mm @ nasal
    if column == "distance_px" and _moves_back(nasal_mm[known], table.loc[known, column].to_numpy()):
        nasal_mm = -nasal_mm
    return up_mm, nasal_mm


def _moves_back(place_mm: Array, distance: Array) -> bool:
    shut = distance < (distance.min() + distance.max()) / 2
    if not shut.any():
        return False
    return bool(np.median(place_mm[shut]) < np.median(place_mm[~shut]))
