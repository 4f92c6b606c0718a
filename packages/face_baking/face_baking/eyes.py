"""Eyeballs, the wet film over them and the tear line of one side, as meshes of quads; lengths in cm."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from face_baking.blink_path import BlinkPath, nasal_tip
from face_baking.hair import edge_line
from face_baking.kit import Array, Index
from face_baking.lid_loops import EDGE_LOOP
from face_baking.sphere import IRIS_CM, spherical, surface_radius
from stimuli_builder.characters.colour import smooth

TEXTURE_LIMIT = 1.25
"""Radians from the gaze axis at the edge of the eye's texture."""
_SHADE_REACH_CM = (0.34, 0.10)
_SHADE_DEPTH = (0.60, 0.42)
_FLUSHED_CM = (0.16, 0.36)
"""Distances from the nasal corner between which the eye's white turns from the corner's pink to its own."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (n, 3), quads (m, 4), UVs (n, 2) where textured, and per-vertex values by name."""

    vertices: Array
    quads: Index
    uv: Array | None = None
    values: dict[str, Array] = field(default_factory=dict)


def eyeball(path: BlinkPath, posed: Array, side: int, stroke: float) -> Mesh:
    """Iris plane and sclera. `shade` is the light that lids and lashes leave near their edges."""
    radius = path.globes[side].radius
    limbus = float(np.arcsin(IRIS_CM / radius))

    def profile(angle: Array) -> Array:
        depth = radius * np.cos(limbus) - 0.035 - 0.05 * np.clip(1 - angle / limbus, 0, 1)
        plane = np.minimum(radius, depth / np.maximum(np.cos(angle), 0.2))
        return np.where(angle < limbus, plane, radius - 0.035 * np.exp(-((angle - limbus) / 0.05)))

    mesh, angle = _dome(path, side, stroke, profile, 1.45, (150, 96))
    # One texture, half a turn further on the other side: two irises whose fibers agreed looked copied.
    uv = mesh.uv if side > 0 or mesh.uv is None else 1 - mesh.uv
    sclera = smooth(limbus - 0.01, limbus + 0.05, angle)
    # Between lids that meet, shadows that are rendered leave little: this one would make the slit black.
    shade = 1 - (1 - _lid_shade(path, posed, side, mesh.vertices)) * (1 - 0.35 * stroke)
    from_corner = np.linalg.norm(mesh.vertices - nasal_tip(path, path.rest, side, EDGE_LOOP), axis=1)
    flush = smooth(_FLUSHED_CM[1], _FLUSHED_CM[0], from_corner) * sclera
    return Mesh(mesh.vertices, mesh.quads, uv, {"sclera": sclera, "shade": shade, "flush": flush})


def wet_film(path: BlinkPath, side: int, stroke: float) -> Mesh:
    """Cornea and tear film: the eye's outer surface."""
    radius = path.globes[side].radius
    mesh, _ = _dome(path, side, stroke, lambda a: surface_radius(a, radius) + 0.004, 1.40, (120, 96))
    return Mesh(mesh.vertices, mesh.quads)


def _dome(
    path: BlinkPath,
    side: int,
    stroke: float,
    profile: Callable[[Array], Array],
    limit: float,
    size: tuple[int, int],
) -> tuple[Mesh, Array]:
    """Surface of revolution about the gaze axis, and each vertex's angle from it."""
    rings, sectors = size
    ahead = path.gaze(side, stroke)
    right = np.cross([0, 1.0, 0], ahead)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(ahead, right), ahead])
    angle, turn = np.meshgrid(
        np.linspace(0, limit, rings + 1), np.linspace(0, 2 * np.pi, sectors, endpoint=False), indexing="ij"
    )
    r = profile(angle)
    local = np.stack(
        [r * np.sin(angle) * np.cos(turn), r * np.sin(angle) * np.sin(turn), r * np.cos(angle)], -1
    )
    uv = 0.5 + angle[..., None] / TEXTURE_LIMIT * 0.5 * np.stack([np.cos(turn), np.sin(turn)], -1)
    vertices = path.globes[side].centre + local.reshape(-1, 3) @ frame
    return Mesh(vertices, _tube_quads(rings, sectors), uv.reshape(-1, 2)), angle.ravel()


def _tube_quads(rings: int, sectors: int) -> Index:
    ring, sector = np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij")
    following = (sector + 1) % sectors
    corners = [ring * sectors + sector, (ring + 1) * sectors + sector]
    corners += [(ring + 1) * sectors + following, ring * sectors + following]
    return np.asarray(np.stack(corners, -1).reshape(-1, 4))


def _lid_shade(path: BlinkPath, posed: Array, side: int, vertices: Array) -> Array:
    """(n,) share of light left: dark under the upper lid and its lashes, a little above the lower lid."""
    globe = path.globes[side]
    _, azimuth, elevation = spherical(vertices - globe.centre)
    shade = np.ones(len(vertices))
    for upper in (True, False):
        edge = edge_line(path, posed, side, EDGE_LOOP, upper)
        _, at, height = spherical(edge - globe.centre)
        order = np.argsort(at)
        distance = (np.interp(azimuth, at[order], height[order]) - elevation) * globe.radius
        distance = np.clip(distance if upper else -distance, 0, None)
        reach, depth = (pair[0 if upper else 1] for pair in (_SHADE_REACH_CM, _SHADE_DEPTH))
        shade *= 1 - depth * np.exp(-((distance / reach) ** 1.2))
    return shade


def tear_line(path: BlinkPath, posed: Array, side: int, stroke: float) -> Mesh:
    """Meniscus where the lower lid's edge meets the globe."""
    centre = path.globes[side].centre
    edge = edge_line(path, posed, side, EDGE_LOOP, False)
    away = edge - centre
    radius = np.linalg.norm(away, axis=1)
    gap = path.clearance(edge, side, stroke)
    line = centre + away / radius[:, None] * (radius - gap + 0.012)[:, None] + np.array([0, 0.012, 0])
    along = np.arange(len(line))
    # It thins out well before the temporal corner: there a wide one mirrors a light as a white bar.
    inset = np.minimum(along / 14, along[::-1] / 60)
    thickness = 0.018 * np.clip(inset, 0, 1) * (1 - 0.7 * smooth(0.9, 1.0, stroke))
    return tube(line, thickness)


def tube(line: Array, radius: Array, sectors: int = 10) -> Mesh:
    """A tube along (n, 3) points with a radius at each."""
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True) + 1e-9
    first = np.cross(along, [0, 0, 1.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True) + 1e-9
    second = np.cross(along, first)
    turn = np.linspace(0, 2 * np.pi, sectors, endpoint=False)[None, :, None]
    around = np.cos(turn) * first[:, None] + np.sin(turn) * second[:, None]
    vertices = line[:, None] + radius[:, None, None] * around
    return Mesh(vertices.reshape(-1, 3), _tube_quads(len(line) - 1, sectors))
