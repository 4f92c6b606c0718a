"""What a moved lower lid adds to a frame, straight from its formula: the oracle of what clips compute."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from stimuli_builder.characters.atlas import Atlas


def lower_lid_change(
    atlas: Atlas, closure: float, vertical_mm: float, horizontal_mm: float
) -> NDArray[np.float32]:
    """(h, w, 3) linear light to add to the crop: change(v, h) bilinear in pose, times factor(w)."""
    layer = atlas.lower_lid_layer
    poses = RegularGridInterpolator((layer.vertical_mm, layer.horizontal_mm), layer.changes)
    change = poses([[vertical_mm, horizontal_mm]])[0]
    factors = np.stack([layer.factor_at(index) for index in range(len(layer.matte_closures))])
    if len(factors) > 1:
        held = np.clip(closure, layer.matte_closures[0], layer.matte_closures[-1])
        factor = RegularGridInterpolator((layer.matte_closures,), factors)([[held]])[0]
    else:
        factor = factors[0]
    whole = np.zeros((atlas.declaration.crop[3], atlas.declaration.crop[2], 3), np.float32)
    whole[layer.window] = change * factor
    return whole
