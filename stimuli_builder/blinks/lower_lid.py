"""How the lower eyelid moves in a blink: as a track measured it, else from physiology."""

from zlib import crc32

import numpy as np

from stimuli_builder.blinks.profile import Array, BlinkProfile

VERTICAL_RANGE_MM = (0.5, 1.0)
HORIZONTAL_RANGE_MM = (1.4, 5.0)


def lower_lid(profile: BlinkProfile, closure: Array | None = None) -> tuple[Array, Array]:
    """Vertical and horizontal displacement of the lower lid during a blink, in mm.

    Measured where a track gave it. Else from physiology: a blink slides the lower lid 1.4-5 mm towards the
    nose and lifts it 0.5-1 mm, together with the upper lid (Doane 1980, Am J Ophthalmol 89:507, describes
    the motion). The peaks for a complete blink are drawn from these ranges, the horizontal one evenly on a
    log scale, by the profile's name: the same profile always moves alike. Both follow the closure; the
    nasal slide lags it by some 10 ms, and nothing moves while the eye is open.

    Parameters
    ----------
    closure : (n,) array, optional
        The profile's closure with the open eye before and after it, in which the lagging slide comes to rest;
        without it the profile's own samples, at whose end the slide is still on its way. Not for a measured
        lower lid.

    Returns
    -------
    vertical_mm, horizontal_mm : (n,) float64 arrays
        Upwards and towards the nose positive, 0 with the eye open, at the profile's rate.
    """
    if profile.lower_up_mm is not None and profile.lower_nasal_mm is not None:
        return profile.lower_up_mm, profile.lower_nasal_mm
    rng = np.random.default_rng(crc32(profile.profile_id.encode()))
    vertical_peak_mm = rng.uniform(*VERTICAL_RANGE_MM)
    horizontal_peak_mm = float(np.exp(rng.uniform(*np.log(HORIZONTAL_RANGE_MM))))
    shown = profile.closure if closure is None else closure
    return vertical_peak_mm * shown, horizontal_peak_mm * _lagged(shown, profile.fps)


def _lagged(closure: Array, fps: int, time_constant_ms: float = 10.0) -> Array:
    """First-order lag of the closure, starting from its first sample; never above the closure's peak."""
    share = 1.0 - np.exp(-1000.0 / (fps * time_constant_ms))
    lagged = np.empty_like(closure)
    level = float(closure[0])
    for index, value in enumerate(closure):
        level += share * (float(value) - level)
        lagged[index] = level
    return lagged
