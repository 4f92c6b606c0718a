"""Directions about a globe's center, and the eye's surface with its cornea; cm and radians."""

import numpy as np

from face_baking.kit import Array

IRIS_CM, CORNEA_CM = 0.60, 0.83
_BLEND_CM = 0.02


def spherical(points: Array) -> tuple[Array, Array, Array]:
    """Radius, azimuth (about the vertical) and elevation above the horizontal, each (n,)."""
    radius = np.linalg.norm(points, axis=-1)
    elevation = np.arcsin(np.clip(points[..., 1] / np.maximum(radius, 1e-9), -1, 1))
    return radius, np.arctan2(points[..., 0], points[..., 2]), elevation


def cartesian(radius: Array, azimuth: Array, elevation: Array) -> Array:
    """(n, 3) points; inverse of `spherical`."""
    flat = radius * np.cos(elevation)
    return np.stack([flat * np.sin(azimuth), radius * np.sin(elevation), flat * np.cos(azimuth)], -1)


def slerp(start: Array, end: Array, share: Array) -> Array:
    """(n, 3) unit vectors a (n,) `share` of the way along the great circles from `start` to `end`."""
    angle = np.arccos(np.clip((start * end).sum(-1), -1, 1))
    near = angle < 1e-6
    sine = np.where(near, 1, np.sin(angle))
    first = np.where(near, 1 - share, np.sin((1 - share) * angle) / sine)
    second = np.where(near, share, np.sin(share * angle) / sine)
    return np.asarray(start * first[..., None] + end * second[..., None])


def surface_radius(angle: Array, globe_cm: float) -> Array:
    """Distance of the eye's surface from the globe's center at an angle from the gaze axis.

    The cornea is a sphere of radius 0.83 cm through the limbus (0.60 cm off axis), blended over 0.02 cm.
    """
    edge = np.sqrt(globe_cm**2 - IRIS_CM**2)
    centre = edge - np.sqrt(CORNEA_CM**2 - IRIS_CM**2)
    cosine, sine = np.cos(angle), np.sin(angle)
    under_root = CORNEA_CM**2 - (centre * sine) ** 2
    cornea = np.where(cosine > 0, centre * cosine + np.sqrt(np.clip(under_root, 0, None)), 0)
    blended = globe_cm + _BLEND_CM * np.logaddexp(0, (cornea - globe_cm) / _BLEND_CM)
    return np.asarray(np.where(angle < 1.0, blended, globe_cm))
