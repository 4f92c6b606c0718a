"""The lower lid's own movement: turned about the globe's center, whole at its middle, none at the corners."""

import numpy as np

from face_baking.kit import Array, Index
from face_baking.lid_loops import Globe
from face_baking.sphere import cartesian, spherical
from stimuli_builder.characters.colour import smooth

_WHOLE_LOOP, _STILL_LOOP = 3.5, 11.0


def lower_lid_weight(loop: Array, below: Array, along: Array) -> Array:
    """(n,) share of the lower lid's movement that a vertex follows.

    Parameters
    ----------
    loop : float64 array (n,)
        Number of the vertex's loop, continued between loops.
    below : float64 array (n,)
        1 below the line through the eye's corners, 0 above.
    along : float64 array (n,)
        Way from the nasal corner (0) to the temporal one (1).
    """
    inside = np.clip(along, 0, 1)
    return np.asarray(below * np.sin(np.pi * inside) * smooth(_STILL_LOOP, _WHOLE_LOOP, loop))


def moved_lower_lid(
    points: Array, weight: Array, globe: Globe, side: int, up_cm: float, nasal_cm: float
) -> Array:
    """(n, 3) points turned about the globe by so many cm along its surface, times their weight."""
    radius, azimuth, elevation = spherical(points - globe.centre)
    edge = globe.radius + 0.05
    turned = azimuth - side * weight * nasal_cm / edge
    lifted = elevation + weight * up_cm / edge
    return np.asarray(globe.centre + cartesian(radius, turned, lifted))


def turned_about(points: Array, chosen: Index, globe: Globe, up: Array) -> Array:
    """(n, 3) points, those chosen turned upward about the globe by individual radians."""
    out = points.copy()
    radius, azimuth, elevation = spherical(points[chosen] - globe.centre)
    out[chosen] = globe.centre + cartesian(radius, azimuth, elevation + up)
    return out
