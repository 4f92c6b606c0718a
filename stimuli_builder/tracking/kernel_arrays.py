"""What the compiled fit is given: named arrays of the mesh, of the model, and buffers."""

from typing import Any, NamedTuple


class MeshArrays(NamedTuple):
    """The base mesh of V vertices and N pixels.

    Attributes
    ----------
    vertices : float64 array (V, 2)
    triangles : int array (T, 3)
    starts : int array (T + 1,)
        First pixel of each triangle.
    forms : float32 array (T, 3, 3)
        Barycentric coordinates as linear forms in (x, y, 1).
    x, y : float32 array (N,)
        Pixel positions.
    ends : int array (eyes,)
        One past the last pixel of each eye.
    left, right, above, below : uint32 array (N,)
        Neighbours of each pixel.
    """

    vertices: Any
    triangles: Any
    starts: Any
    forms: Any
    x: Any
    y: Any
    ends: Any
    left: Any
    right: Any
    above: Any
    below: Any


class ModelArrays(NamedTuple):
    """What the fit needs of a model of l coupled parameters, K = l + 4.

    Attributes
    ----------
    shape_modes : float64 array (l, V, 2)
    appearance : float32 array (l + 1, N)
    weights : float32 array (N,)
    shares : float32 array (N,)
        1 / (weight times the sum of the eye's weights).
    hessian_forms : float64 array (pairs, K (K + 1) / 2)
    directions : float64 array (K, V, 2)
    prior, limits : float64 array (l,)
    scales : float64 array (4,)
    centre : float64 array (2,)
    """

    shape_modes: Any
    appearance: Any
    weights: Any
    shares: Any
    hessian_forms: Any
    directions: Any
    prior: Any
    limits: Any
    scales: Any
    centre: Any


class Buffers(NamedTuple):
    """Written by every fit: float32 (N,) five times, float32 (V, 2), and float64 (eyes,)."""

    sampled: Any
    look: Any
    error: Any
    gx: Any
    gy: Any
    vertices: Any
    squares: Any
