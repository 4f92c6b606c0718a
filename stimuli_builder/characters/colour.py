"""sRGB code values and linear light (IEC 61966-2-1): the two encodings that pictures have here."""

import numpy as np
from numpy.typing import NDArray


def _linear_table() -> NDArray[np.float32]:
    code = np.arange(256) / 255.0
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


LINEAR_OF_CODE = _linear_table()


def srgb_to_linear(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light in 0-1, same shape, of 8-bit sRGB code values."""
    return LINEAR_OF_CODE[image]


def encode_srgb(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Gamma-encoded sRGB in 0-1 of linear light; values outside 0-1 are clipped."""
    light = np.clip(linear, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)


def linear_to_srgb(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit sRGB code values, rounded to nearest, of linear light."""
    return (encode_srgb(linear) * 255.0 + 0.5).astype(np.uint8)
