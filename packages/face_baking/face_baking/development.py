"""From the renderer's scene light to the picture's: a lens, exposure, a soft shoulder, a slight S-curve."""

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.colour import encode_srgb

SHOULDER_STARTS, CONTRAST = 0.55, 0.2
LENS_PX = 0.55
"""Spread of a point of light over the picture, standard deviation of a Gaussian.

As of a good lens before a sensor with color filters: without it every edge is cut out, and hair is dots.
"""


def photographed(
    scene_light: NDArray[np.floating], exposure_ev: float, lens_px: float = LENS_PX
) -> NDArray[np.float32]:
    """Gamma-encoded sRGB in 0-1 of what a lens makes of scene-linear light.

    Parameters
    ----------
    scene_light : float array (h, w, 3)
        Light as rendered.
    exposure_ev : float
        Exposure in stops.
    lens_px : float, optional
        Spread of a point in pixels, standard deviation; 0 for none, as of faces of recipes before 17.
    """
    if lens_px == 0:
        return develop(scene_light, exposure_ev)
    light = np.maximum(scene_light.astype(np.float32), 0)
    spread = cv2.GaussianBlur(light, (0, 0), lens_px, borderType=cv2.BORDER_REPLICATE)
    return develop(np.asarray(spread, np.float32), exposure_ev)


def develop(scene_light: NDArray[np.floating], exposure_ev: float) -> NDArray[np.float32]:
    """Gamma-encoded sRGB in 0-1 of scene-linear light, same shape."""
    light = np.maximum(scene_light.astype(np.float32), 0) * np.float32(2.0**exposure_ev)
    room = 1 - SHOULDER_STARTS
    bent = SHOULDER_STARTS + room * (1 - np.exp(-(light - SHOULDER_STARTS) / room))
    code = encode_srgb(np.where(light < SHOULDER_STARTS, light, bent))
    return np.clip(code + CONTRAST * (code - 0.5) * code * (1 - code), 0, 1).astype(np.float32)


def to_8_bit(code: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Rounded code values."""
    return (code * 255 + 0.5).astype(np.uint8)


def psnr_db(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Peak signal-to-noise ratio of two 8-bit pictures in dB; infinite where they are equal."""
    return error_db(float(np.mean((a.astype(np.float64) - b.astype(np.float64)) ** 2)))


def error_db(square: float) -> float:
    """Peak signal-to-noise ratio in dB of a mean square error in code values; infinite where it is none."""
    return float("inf") if square <= 0 else float(10 * np.log10(255**2 / square))


def error_and_noise(
    shown: NDArray[np.uint8], first: NDArray[np.uint8], second: NDArray[np.uint8]
) -> tuple[float, float]:
    """Mean square error of a picture against truth, and that of the mean of two references, code values.

    Parameters
    ----------
    shown : uint8 array (h, w, 3)
        The picture that is judged.
    first, second : uint8 arrays (h, w, 3)
        Renders of the truth, each with independent noise.
    """
    a, b = first.astype(np.float64), second.astype(np.float64)
    noise = float(np.mean((a - b) ** 2)) / 4
    return float(np.mean((shown.astype(np.float64) - (a + b) / 2) ** 2)) - noise, noise
