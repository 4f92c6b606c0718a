"""Eyeball, cornea, caruncle and tear film; each mesh is (vertices (n, 3), quads (m, 4)) in mm."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.curves import Array, smooth_maximum
from stimuli_builder.characters.photorealistic.eyelid_skin import LidEdges

EYE_UV_RADIANS = 4.0
PUPIL_RADIUS_MM = 2.0


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, 3), quads (m, 4), UVs (n, 2) if textured, and per-vertex values by name."""

    vertices: Array
    quads: NDArray[np.int64]
    uv: Array | None = None
    values: dict[str, Array] = field(default_factory=dict)


def _grid_quads(rows: int, columns: int, closed: bool) -> NDArray[np.int64]:
    index = np.arange(rows * columns).reshape(rows, columns)
    left, right = (index, np.roll(index, -1, 1)) if closed else (index[:, :-1], index[:, 1:])
    return np.asarray(np.stack([left[:-1], right[:-1], right[1:], left[1:]], -1).reshape(-1, 4))


def _lathe(profile: Array, segments: int) -> Array:
    turn = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    radius, z = profile[:, :1], np.broadcast_to(profile[:, 1:], (len(profile), segments))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], -1).reshape(-1, 3)


def eyeball(segments: int = 160) -> Mesh:
    """Iris with a sunken pupil and the sclera, one lathe looking along +z, centred on the globe.

    UVs are azimuthal equidistant over 4 radians; `sclera` is 1 outside the iris.
    """
    limbus = anatomy.IRIS_RADIUS_MM + 0.05
    r = np.concatenate([np.linspace(0, 1.9, 8), np.linspace(2.0, limbus - 0.2, 60)])
    z = 10.15 - 0.32 * (r - 2) / (limbus - 2.2) + 0.25 * np.exp(-(((r - 2.6) / 0.8) ** 2))
    z = np.where(r < 1.95, 8.6, z - 0.3 * np.exp(-(((r - 1.95) / 0.12) ** 2)))
    rim = np.arcsin((limbus + 0.05) / anatomy.GLOBE_RADIUS_MM)
    angle = np.concatenate([np.linspace(rim, rim + 0.12, 10), np.linspace(rim + 0.13, 2.2, 90)])
    globe = anatomy.GLOBE_RADIUS_MM * np.stack([np.sin(angle), np.cos(angle)], -1)
    profile = np.concatenate([np.stack([r, z], -1), globe])
    vertices = _lathe(profile, segments)
    off_axis = np.hypot(vertices[:, 0], vertices[:, 1])
    polar = np.arcsin(np.clip(off_axis / anatomy.GLOBE_RADIUS_MM, 0, 1))
    polar = np.where(off_axis < limbus, off_axis / anatomy.GLOBE_RADIUS_MM, polar)
    polar = np.where(vertices[:, 2] < 0, np.pi - polar, polar)
    turn = np.arctan2(vertices[:, 1], vertices[:, 0])
    uv = 0.5 + polar[:, None] * np.stack([np.cos(turn), np.sin(turn)], -1) / EYE_UV_RADIANS
    sclera = np.clip((off_axis - (limbus - 0.2)) / 0.35, 0, 1)
    return Mesh(vertices, _grid_quads(len(profile), segments, True), uv, {"sclera": sclera})


def cornea(segments: int = 128) -> Mesh:
    """Corneal cap, blended into the globe at the limbus."""
    angle = np.linspace(0, np.arcsin((anatomy.IRIS_RADIUS_MM + 0.25) / anatomy.CORNEA_RADIUS_MM), 40)
    r = anatomy.CORNEA_RADIUS_MM * np.sin(angle)
    cap = anatomy.CORNEA_CENTRE_Z_MM + anatomy.CORNEA_RADIUS_MM * np.cos(angle)
    globe = np.sqrt(np.maximum(anatomy.GLOBE_RADIUS_MM**2 - r**2, 0)) + 0.02
    profile = np.stack([r, smooth_maximum(cap, globe, 0.5)], -1)
    return Mesh(_lathe(profile, segments), _grid_quads(len(profile), segments, True))


# Caruncle, plica and the fleshy backing of both canthi: centre (local x, y, z), radii, bumpiness.
_FLESH = (
    ((-12.9, -1.75, 6.0), (2.3, 1.55, 1.9), 0.10),
    ((-10.8, -1.6, 4.6), (1.6, 3.6, 2.1), 0.03),
    ((-12.0, -1.5, 3.2), (4.0, 4.2, 3.4), 0.0),
    ((11.9, 0.2, 0.6), (2.6, 3.2, 2.6), 0.0),
)


def flesh(side: int, seed: int) -> list[tuple[Mesh, tuple[float, float, float]]]:
    """Meshes with their places: the pink tissue in both corners of one eye."""
    placed = []
    for (x, y, z), radii, bumpiness in _FLESH:
        placed.append((_bumpy_ellipsoid(radii, bumpiness, seed), (side * (anatomy.EYE_X_MM + x), y, z)))
    return placed


def _bumpy_ellipsoid(radii: tuple[float, float, float], bumpiness: float, seed: int, rows: int = 40) -> Mesh:
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, 2 * rows, endpoint=False), indexing="ij"
    )
    direction = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    rng = np.random.default_rng(seed)
    waves = sum(np.cos(direction @ (rng.normal(size=3) * 5) + rng.uniform(0, 6.28)) / 8 for _ in range(30))
    vertices = direction * np.array(radii) * (1 + bumpiness * np.asarray(waves)[..., None])
    return Mesh(vertices.reshape(-1, 3), _grid_quads(rows, 2 * rows, True)[:, ::-1])


def tear_film(edges: LidEdges, side: int) -> Mesh:
    """Concave strip of tears between the lower lid's back edge and the eyeball."""
    chosen = (edges.open_height > 0.9) & (np.sign(edges.x) == side)
    back, local = edges.lower_back[chosen], edges.local_x[chosen]
    rows = []
    for share in np.linspace(0, 1, 7):
        y = back[:, 1] - 0.28 + 0.60 * share
        z = anatomy.globe_surface(local, y, 0.03) + 0.55 * (1 - share) ** 2
        rows.append(np.stack([back[:, 0], y, z], -1))
    strip = np.stack(rows)
    return Mesh(strip.reshape(-1, 3), _grid_quads(strip.shape[0], strip.shape[1], False))
