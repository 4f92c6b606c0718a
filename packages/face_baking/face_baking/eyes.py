"""Eyeballs, the wet film over them and the tear line of one side, as meshes of quads; lengths in cm."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from face_baking.blink_path import BlinkPath, nasal_tip
from face_baking.field_noise import value_noise
from face_baking.hair import edge_line
from face_baking.kit import Array, Index
from face_baking.lid_loops import EDGE_LOOP
from face_baking.sphere import IRIS_CM, spherical, surface_radius
from stimuli_builder.characters.colour import smooth

TEXTURE_LIMIT = 1.25
"""Radians from the gaze axis at the edge of the eye's texture."""
_SHADE_REACH_CM = (0.42, 0.16)
_SHADE_DEPTH = (0.62, 0.40)
_TURNED_AWAY, _TURNED_DEPTH = (0.55, 1.25), 0.32
"""Radians from the gaze axis between which the white loses that share of its light to brow and nose."""
CARUNCLE_AT, CARUNCLE_CM = 17, (0.27, 0.03, 0.085)
"""Point of the lids' edges (of 200) about which the corner's flesh lies; its half length, what of its half
height lies under either lid, and its half depth, cm."""
CARUNCLE_LIGHT, CARUNCLE_SINKS = (0.85, 1.7), 0.22
"""Its lightness over the white's, with dark and with light skin, where the darker one looked burned; and the
slope at which its temporal half sinks into the white."""
_PLICA_CM, _PLICA_WIDE_CM, _PLICA_HIGH_CM = 0.40, 0.07, 0.028
"""Way of the plica's crest from the corner's tip, its half width, and its height under the film."""
_FLUSHED_CM = (0.30, 0.46)
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
    turned = 1 - _TURNED_DEPTH * smooth(*_TURNED_AWAY, angle)
    # Between lids that meet, shadows that are rendered leave little: this one would make the slit black.
    shade = turned * (1 - (1 - _lid_shade(path, posed, side, mesh.vertices)) * (1 - 0.35 * stroke))
    shade, flush, plica = _nasal_end(path, side, mesh.vertices, sclera, shade)
    out = mesh.vertices - path.globes[side].centre
    out *= 1 + (_PLICA_HIGH_CM * plica / np.maximum(np.linalg.norm(out, axis=1), 0.1))[:, None]
    values = {"sclera": sclera, "shade": shade, "flush": flush}
    return Mesh(path.globes[side].centre + out, mesh.quads, uv, values)


def _nasal_end(
    path: BlinkPath, side: int, vertices: Array, sclera: Array, shade: Array
) -> tuple[Array, Array, Array]:
    """(n,) shade and flush of the white, and the height of its nasal fold, the plica, as a share."""
    away = (vertices - nasal_tip(path, path.rest, side, EDGE_LOOP))[:, :2]
    from_corner = np.hypot(away[:, 0], 0.6 * away[:, 1])
    plica = np.exp(-(((from_corner - _PLICA_CM) / _PLICA_WIDE_CM) ** 2)) * sclera
    corner = smooth(_PLICA_CM + 0.06, _PLICA_CM - 0.08, from_corner) * sclera
    nasal = smooth(_PLICA_CM + 0.50, _PLICA_CM, from_corner) * sclera
    # Both lids are near there, and what is rendered of their shadow is enough.
    shade = 1 - (1 - shade) * (1 - 0.6 * nasal) * (1 - 0.5 * corner)
    flush = np.maximum(smooth(_FLUSHED_CM[1], _FLUSHED_CM[0], from_corner) * sclera, 0.8 * plica)
    crease = np.exp(-(((from_corner - _PLICA_CM - 1.2 * _PLICA_WIDE_CM) / 0.03) ** 2))
    return shade * (1 - 0.12 * crease * sclera), flush, plica


def caruncle(path: BlinkPath, posed: Array, side: int, stroke: float, melanin: float) -> Mesh:
    """The flesh between the lids' nasal ends, a bare and wet knob; shut lids press it flat."""
    ends = np.stack([edge_line(path, posed, side, EDGE_LOOP, upper) for upper in (True, False)])
    high, low = ends[:, CARUNCLE_AT]
    along = ends[:, 2 * CARUNCLE_AT].mean(0) - ends[:, 0].mean(0)
    along /= np.linalg.norm(along)
    length, under, depth = CARUNCLE_CM
    half_height = (high[1] - low[1]) / 2 + under
    rings, sectors = 24, 32
    around = np.linspace(0, 2 * np.pi, sectors, endpoint=False)
    polar, turn = np.meshgrid(np.linspace(0, 0.6 * np.pi, rings + 1), around, indexing="ij")
    round_it = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1)
    local = round_it.reshape(-1, 3) * np.array([length * (1 - 0.3 * stroke), half_height, depth])
    local *= 1 + 0.07 * value_noise(local * np.array([side * 14.0, 14.0, 14.0]), 3 + side, 2)[:, None]
    # Of one height to its end, it ended before the white as if cut off.
    temporal = np.clip(local[:, 0] / length, 0, 1)
    local[:, 1] *= 1 - 0.4 * temporal**2
    local[:, 2] -= CARUNCLE_SINKS * np.clip(local[:, 0], 0, None)
    middle = (high + low) / 2 - np.array([0, 0, depth * (1.0 + 0.4 * stroke)])
    vertices = middle + local[:, :1] * along + local[:, 1:] @ np.array([[0, 1.0, 0], [0, 0, 1.0]])
    dark, light = CARUNCLE_LIGHT
    whole = np.ones(len(vertices))
    lightness = dark + (light - dark) * smooth(0.9, 0.3, np.asarray(melanin))
    values = {"sclera": whole, "shade": lightness * whole, "flush": whole}
    return Mesh(vertices, _tube_quads(rings, sectors), np.full((len(vertices), 2), 0.93), values)


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
    inset = np.clip(along[::-1] / 40, 0, 1)
    lake = 1.6 * np.exp(-(((along - 10) / 8) ** 2))
    thickness = 0.024 * (inset + lake) * (1 - 0.7 * smooth(0.9, 1.0, stroke))
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
