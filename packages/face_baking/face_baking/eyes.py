"""Eyeballs, the wet film over them and the tear line of one side, as meshes of quads; lengths in cm."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
_SHADE_DEPTH = (0.54, 0.40)
_TURNED_AWAY, _TURNED_DEPTH = (0.55, 1.25), 0.12
"""Radians from the gaze axis between which the white loses that share of its light to brow and nose."""
_KEY_LIGHT, _EVENED = np.array([-0.5, 0.46, 0.74]), 0.4
"""Direction of the studio's key light, and how far the white evens out its shading: light wanders for
millimeters below it, and without that its far side was gray."""
CARUNCLE_LIGHT = (0.85, 1.7)
"""Lightness of the corner's flesh over the white's, with dark and with light skin: there the darker one
looked burned."""
_FLOORS = {True: (0.075, (0.12, 0.95)), False: (0.035, (0.0, 0.55))}
"""How deep the floor of the nasal corner, and of the temporal one, lies below the lids' edges; from and to
which way from the tip it falls to the globe, cm."""
_FLESH_CM, _FLESH_HIGH_CM = (0.20, 0.19), 0.065
"""Way of the caruncle's middle from the corner's tip, its half length, and its height over the floor."""
_PLICA_CM, _PLICA_WIDE_CM, _PLICA_HIGH_CM = 0.45, 0.07, 0.022
"""Way of the plica's crest from the corner's tip, its half width, and its height over the floor."""
_FLOOR_SOFT_CM, _FLOOR_UNDER_CM = 0.04, 0.12
"""How softly the floor runs into the globe, and how far it reaches under either lid."""
_FLUSHED_CM = (0.30, 0.66)
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
    shade, flush = _nasal_end(path, side, mesh.vertices, sclera, shade)
    shade = shade * (1 + sclera * (_evened(path, side, mesh.vertices) - 1))
    return Mesh(mesh.vertices, mesh.quads, uv, {"sclera": sclera, "shade": shade, "flush": flush})


def _evened(path: BlinkPath, side: int, vertices: Array) -> Array:
    """(n,) light over what the key light alone leaves on the white, most on its far side next to the nose."""
    outward = vertices - path.globes[side].centre
    lit = np.clip(outward @ _KEY_LIGHT / np.linalg.norm(outward, axis=1), 0.2, 1)
    return np.asarray((0.8 / lit) ** (_EVENED + 0.2 * _nasal_share(path, side, vertices)))


def _nasal_end(
    path: BlinkPath, side: int, vertices: Array, sclera: Array, shade: Array
) -> tuple[Array, Array]:
    """(n,) shade and flush of the white near the nose."""
    nasal = _nasal_share(path, side, vertices) * sclera
    # Both lids are near there, and what is rendered of their shadow is enough.
    shade = 1 - (1 - shade) * (1 - 0.8 * nasal)
    return shade, smooth(_FLUSHED_CM[1], _FLUSHED_CM[0], _from_corner(path, side, vertices)) * sclera


def _from_corner(path: BlinkPath, side: int, vertices: Array) -> Array:
    """(n,) distances from the nasal corner's tip in cm; heights count less."""
    away = (vertices - nasal_tip(path, path.rest, side, EDGE_LOOP))[:, :2]
    return np.hypot(away[:, 0], 0.6 * away[:, 1])


def _nasal_share(path: BlinkPath, side: int, vertices: Array) -> Array:
    """(n,) 1 from the plica to the nose, 0 from 6.5 mm before it on."""
    return smooth(_PLICA_CM + 0.65, _PLICA_CM, _from_corner(path, side, vertices))


def corner_floor(
    path: BlinkPath, posed: Array, side: int, stroke: float, nasal: bool, melanin: float
) -> Mesh:
    """The wet floor between the lids' ends: lake, flesh and plica at the nose, the white's end at the temple.

    The lids leave the globe there by 1 to 4 mm, and what lies between was a dark gap.
    """
    globe, (lake, falls) = path.globes[side], _FLOORS[nasal]
    points, way, across, front = _between_lids(path, posed, side, nasal)
    out = points - globe.centre
    radius = np.linalg.norm(out, axis=-1)
    stays = 1 - smooth(*falls, way)
    height = (radius - globe.radius) * stays - lake - 0.12 * (1 - stays)
    height = height - 0.04 * stroke - 0.03 * across**4 - 0.3 * np.clip(-way, 0, None)
    flesh, plica = _flesh_and_plica(way, across, side)
    height += nasal * (_FLESH_HIGH_CM * flesh + _PLICA_HIGH_CM * plica) * (1 - 0.5 * stroke)
    above = _FLOOR_SOFT_CM * np.logaddexp(0, height / _FLOOR_SOFT_CM)
    angle, _ = _eye_uv(path, side, stroke, points.reshape(-1, 3))
    # The texture's place is the open eye's, so that the floor's veins do not swim under moving lids.
    _, uv = _eye_uv(path, side, 0.0, _between_lids(path, path.rest, side, nasal)[0].reshape(-1, 3))
    # Below the white before the iris's rim, and below the iris itself: before it, its end was a dark line.
    sunk = 0.004 + 0.06 * smooth(0.65, 0.48, angle) + 0.4 * smooth(0.48, 0.41, angle)
    sunk = sunk.reshape(height.shape)
    out *= ((globe.radius + above - sunk - 0.15 * ~front) / radius)[..., None]
    vertices = (globe.centre + out).reshape(-1, 3)
    whole = np.ones(len(vertices))
    shade = 1 - _TURNED_DEPTH * smooth(*_TURNED_AWAY, angle)
    shade = shade * (1 - (1 - _lid_shade(path, posed, side, vertices)) * (1 - 0.35 * stroke))
    if nasal:
        shade, flush = _nasal_end(path, side, vertices, whole, shade)
        # As the globe where it meets it: elsewhere the floor faces the light.
        meets = smooth(0.04, -0.04, height).ravel()
        shade = shade * (1 + meets * (_evened(path, side, vertices) - 1))
        dark, light = CARUNCLE_LIGHT
        lightness = dark + (light - dark) * float(smooth(0.9, 0.3, np.asarray(melanin)))
        # The flesh ends in an arc with an uneven edge: a straight one showed as an upright seam.
        places = np.stack(np.broadcast_arrays(9 * way, 2.1 * across, side), -1).reshape(-1, 3)
        uneven = 0.05 * value_noise(places, 31 + side, 2).reshape(height.shape)
        share = smooth(_PLICA_CM + 0.10, _PLICA_CM - 0.24, way - 0.16 * across**2 + uneven).ravel()
        shade = shade + share * (lightness * (0.7 + 0.3 * np.clip(flesh, 0, 1)).ravel() - shade)
    else:
        flush = (0.5 * smooth(0.22, 0.02, way) * np.ones_like(height)).ravel()
    rings, sectors = height.shape
    values = {"sclera": whole, "shade": shade, "flush": flush}
    return Mesh(vertices, _tube_quads(rings - 1, sectors), uv, values)


def _between_lids(
    path: BlinkPath, posed: Array, side: int, nasal: bool
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """(n, m, 3) points between the lids' edges from one end on, round a flat tube; its front's and back's.

    Also (n, 1) way from the tip, below 0 beyond it, (1, m) way across from lower to upper lid, -1 to 1, and
    (1, m) whether a point is on the tube's front.
    """
    upper, lower = (
        edge_line(path, posed, side, EDGE_LOOP, up)[:: 1 if nasal else -1][:72] for up in (True, False)
    )
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
    beyond = middle[0] - middle[30]
    before = np.linspace(-0.25, -0.01, 12)
    middle = np.vstack([middle[0] - before[:, None] * beyond / np.linalg.norm(beyond), middle])
    half = np.vstack([np.zeros((len(before), 3)), half])
    way = np.concatenate([before, way])[:, None]
    across = np.concatenate([np.linspace(-1, 1, 25), np.linspace(1, -1, 9)[1:-1]])[None]
    points = middle[:, None] + half[:, None] * across[..., None]
    # The tip is blunt, and the lines of its edges are rounded: past it there was a hole.
    points[..., 1] += (_FLOOR_UNDER_CM + 0.08 * smooth(0.25, 0.0, way)) * across
    return points, way, across, np.arange(across.size)[None] < 25


def _flesh_and_plica(way: Array, across: Array, side: int) -> tuple[Array, Array]:
    """(n, m) shares of the caruncle's and the plica's height."""
    along = (way - _FLESH_CM[0]) / _FLESH_CM[1]
    dome = np.clip(1 - along**2 - (across / 0.95) ** 2, 0, None) ** 0.6
    where = np.stack(np.broadcast_arrays(13 * way, 1.7 * across, side), -1).reshape(-1, 3)
    grain = value_noise(where, 3 + side, 2).reshape(dome.shape)
    plica = np.exp(-(((way - _PLICA_CM - 0.08 * across**2) / _PLICA_WIDE_CM) ** 2))
    return dome * (1 + 0.40 * grain), plica


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
    frame = _eye_frame(path, side, stroke)
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


def _eye_frame(path: BlinkPath, side: int, stroke: float) -> Array:
    """(3, 3) right, up and ahead of an eye's gaze."""
    ahead = path.gaze(side, stroke)
    right = np.cross([0, 1.0, 0], ahead)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def _eye_uv(path: BlinkPath, side: int, stroke: float, vertices: Array) -> tuple[Array, Array]:
    """(n,) angles from the gaze, and the (n, 2) places in the eye's texture, of points off the globe."""
    local = (vertices - path.globes[side].centre) @ _eye_frame(path, side, stroke).T
    beside = np.hypot(local[:, 0], local[:, 1])
    angle = np.arctan2(beside, local[:, 2])
    uv = 0.5 + side * np.minimum(angle / TEXTURE_LIMIT, 0.97)[:, None] * 0.5 * local[:, :2] / beside[:, None]
    return angle, uv


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
    # Where the lids leave the globe it lies on the corners' floor.
    depth = (radius - np.minimum(gap, 0.05) + 0.012)[:, None]
    line = centre + away / radius[:, None] * depth + np.array([0, 0.012, 0])
    along = np.arange(len(line))
    # It thins out well before the temporal corner: there a wide one mirrors a light as a white bar. Round
    # the tip of the nasal corner it was a bright hook.
    inset = np.clip(along[::-1] / 40, 0, 1) * np.clip((along - 14) / 14, 0, 1)
    lake = 0.5 * np.exp(-(((along - 36) / 10) ** 2))
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
