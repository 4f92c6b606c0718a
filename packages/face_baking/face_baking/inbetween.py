"""Levels between rendered ones, moved rather than cross-faded: skin and lashes follow the optical flow.

Dense inverse search between the two rendered neighbors (Kroeger et al. 2016,
doi:10.1007/978-3-319-46493-0_29).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.colour import linear_to_srgb

Light = NDArray[np.float32]


def flow_mix(low: Light, high: Light, share: float) -> Light:
    """(h, w, 3) picture `share` of the way between two, each moved along the optical flow to the other."""
    grey = [cv2.cvtColor(linear_to_srgb(light), cv2.COLOR_RGB2GRAY) for light in (low, high)]
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    search.setFinestScale(0)
    ahead = _at_share(search.calc(grey[0], grey[1], None), share)
    back = _at_share(search.calc(grey[1], grey[0], None), 1 - share)
    first, second = _moved(low, -share * ahead), _moved(high, -(1 - share) * back)
    return np.asarray((1 - np.float32(share)) * first + np.float32(share) * second, np.float32)


def _at_share(flow: Light, share: float, rounds: int = 6) -> Light:
    """The flow that each pixel in between carries: fixed point of u(p) = flow(p - share u(p))."""
    carried = flow
    for _ in range(rounds):
        carried = _moved(flow, -share * carried)
    return carried


def _moved(light: Light, shift: Light) -> Light:
    """Fetch each pixel from (h, w, 2) px further."""
    height, width = light.shape[:2]
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    x, y = columns + shift[..., 0], rows + shift[..., 1]
    return np.asarray(cv2.remap(light, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.float32)
