"""Where a blink turns: the frame of its minimum, told from its flanks where the bottom is flat."""

import numpy as np

from stimuli_builder.blinks.profile import Array

FLANK = (0.1, 0.5)
"""Parts of the amplitude, from the bottom, between which a flank is steep: they say when the lid turned."""


def turning_frame(smooth: Array, onset: int, lowest: int, end: int, tolerance: float) -> int:
    r"""Frame between onset and end at which closing turns to opening.

    A lid lingers where it turns: noise of a hundredth of the amplitude decides which frame is lowest, and
    the filter moves it towards the slower flank. So frames within `tolerance` of the lowest (as part of the
    amplitude) count alike, and of these the one is taken that parts the bottom as the flanks are steep:

    .. math:: t = t_c + (t_o - t_c) \, T_c / (T_c + T_o) \tag{1}

    t_c and t_o are where closing and opening pass the lower level of FLANK, T_c and T_o how long each takes
    from one level to the other.

    Parameters
    ----------
    smooth : (n,) array
        Filtered distance.
    lowest : int
        Frame of its least value; returned as it is with a tolerance of 0, or where a flank is missing.
    """
    open_level = float(np.interp(lowest, [onset, end], [smooth[onset], smooth[end]]))
    amplitude = open_level - float(smooth[lowest])
    if tolerance == 0 or amplitude <= 0:
        return lowest
    sides = (smooth[onset : lowest + 1][::-1], smooth[lowest : end + 1])
    reach = np.array([[_first_above(side, smooth[lowest] + p * amplitude) for p in FLANK] for side in sides])
    if not np.isfinite(reach).all():
        return lowest
    closing, opening = np.diff(reach, axis=1)[:, 0]
    turn = lowest - reach[0, 0] + reach[:, 0].sum() * closing / (closing + opening)
    alike = np.arange(int(np.ceil(lowest - reach[0, 0])), int(lowest + reach[1, 0]) + 1)
    alike = alike[smooth[alike] <= smooth[lowest] + tolerance * amplitude]
    return int(alike[np.argmin(np.abs(alike - turn))])


def _first_above(values: Array, level: float) -> float:
    """Place, between frames, where `values` first rises through a level; NaN where it does not."""
    above = np.flatnonzero(values > level)
    if not above.size or above[0] == 0:
        return float("nan")
    after = int(above[0])
    return after - 1 + float((level - values[after - 1]) / (values[after] - values[after - 1]))
