"""Iris and sclera on the azimuthal equidistant plane of the eyeball: linear albedo and relative height."""

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.curves import Array, step
from stimuli_builder.characters.photorealistic.eyeball import EYE_UV_RADIANS, PUPIL_RADIUS_MM
from stimuli_builder.characters.photorealistic.noise import Field
from stimuli_builder.characters.photorealistic.parameters import Iris

EXTENT_MM = EYE_UV_RADIANS * anatomy.GLOBE_RADIUS_MM


class _EyePlane:
    """Polar coordinates of the texture, in mm from the pupil's centre."""

    def __init__(self, size: int, seed: int) -> None:
        self.size, self.seed = size, seed
        at = ((np.arange(size) + 0.5) / size - 0.5) * EXTENT_MM
        self.x, self.y = np.meshgrid(at, at)
        self.r, self.angle = np.hypot(self.x, self.y), np.arctan2(self.y, self.x)
        self.share = np.clip((self.r - PUPIL_RADIUS_MM) / (anatomy.IRIS_RADIUS_MM - PUPIL_RADIUS_MM), 0, 1)

    def polar_noise(self, round_count: int, radial_count: float, seed: int, octaves: int) -> Array:
        """Noise that is long along the radius: iris fibres."""
        rng = np.random.default_rng([self.seed, seed])
        total: Array = np.zeros_like(self.r)
        for octave in range(octaves):
            around, outward = round_count * 2**octave, int(radial_count * 2**octave) + 2
            grid = rng.normal(size=(outward + 3, around))
            at = [np.clip(self.r / 6.2, 0, 1) * outward + 0.3, (self.angle / (2 * np.pi) + 0.5) * around]
            total = total + 0.6**octave * map_coordinates(grid, at, order=3, mode="grid-wrap")
        return np.asarray(total / total[self.r < 6].std())

    def noise(self, sigma_mm: float, seed: int) -> Array:
        rng = np.random.default_rng([self.seed, seed])
        coarse = rng.normal(size=(self.size // 4, self.size // 4))
        smooth = gaussian_filter(coarse, sigma_mm * self.size / EXTENT_MM / 4)
        wide = cv2.resize(
            (smooth / smooth.std()).astype(np.float32), (self.size, self.size), interpolation=cv2.INTER_CUBIC
        )
        return np.asarray(wide, dtype=float)


def eye_maps(iris: Iris, seed: int, size: int = 2048) -> tuple[Field, Field]:
    """(size, size, 3) linear albedo and (size, size) height (0.5 is flat), lowest row first."""
    plane = _EyePlane(size, seed)
    fibres, bundles = plane.polar_noise(70, 1.0, 1, 3), plane.polar_noise(26, 1.5, 2, 4)
    broad = plane.polar_noise(9, 2, 3, 3)
    veins = _veins(plane)
    coloured, white = _iris(plane, iris, fibres, bundles, broad), _sclera(plane, veins)
    limbus = anatomy.IRIS_RADIUS_MM + 0.05
    blend = step(limbus - 0.60, limbus + 0.45, plane.r + 0.06 * broad)[..., None]
    ring = (1 - 0.35 * np.exp(-(((plane.r - limbus - 0.1) / 0.5) ** 2)))[..., None]
    albedo = coloured * (1 - blend) + white * blend * ring
    stroma = (plane.r < limbus) & (plane.r > PUPIL_RADIUS_MM)
    height = 0.5 + 0.05 * (fibres + bundles) * stroma
    height = np.where(plane.r > limbus, 0.5 + 0.03 * plane.noise(0.6, 77) + 0.05 * veins, height)
    return np.clip(albedo, 0, 1).astype(np.float32), np.clip(height, 0, 1).astype(np.float32)


def _iris(plane: _EyePlane, iris: Iris, fibres: Array, bundles: Array, broad: Array) -> Array:
    q = plane.share
    stroma = 0.55 + 0.20 * fibres * (0.4 + 0.6 * q) + 0.16 * bundles + 0.10 * broad
    middle = np.exp(-(((q - 0.45) / 0.35) ** 2))[..., None]
    inner = np.clip(np.exp(-(((q - 0.10) / (0.20 + 0.04 * bundles)) ** 2)) * 1.1, 0, 1)[..., None]
    colour = np.array(iris.outer) * (1 - middle) + np.array(iris.middle) * middle
    colour = (
        (colour * (1 - inner) + np.array(iris.inner) * inner) * np.clip(stroma, 0.12, 1.6)[..., None] * 1.35
    )
    collarette = np.exp(-(((q - (0.30 + 0.05 * bundles)) / 0.16) ** 2))
    colour = colour * (1 + 0.35 * collarette * np.clip(bundles, -0.5, 1))[..., None]
    rng = np.random.default_rng([plane.seed, 5])
    for _ in range(26):
        radius = PUPIL_RADIUS_MM + (anatomy.IRIS_RADIUS_MM - PUPIL_RADIUS_MM) * rng.uniform(0.25, 0.6)
        turn = np.angle(np.exp(1j * (plane.angle - rng.uniform(-np.pi, np.pi))))
        crypt = np.hypot((plane.r - radius) / 0.42, turn * radius / 0.20)
        colour = colour * (1 - 0.5 * np.exp(-(crypt**3)))[..., None]
    colour = colour * (1 - 0.75 * step(0.80, 1.02, q + 0.02 * broad))[..., None]
    colour = colour * (1 - 0.6 * np.exp(-(((plane.r - PUPIL_RADIUS_MM) / 0.16) ** 2)))[..., None]
    pupil = (plane.r < PUPIL_RADIUS_MM + 0.02 * fibres)[..., None]
    return np.asarray(np.where(pupil, 0.002, colour))


def _sclera(plane: _EyePlane, veins: Array) -> Array:
    white = np.array([0.80, 0.755, 0.70]) * (1 + 0.02 * plane.noise(1.5, 3))[..., None]
    pink = (
        np.clip((np.abs(plane.x) - 6) / 6, 0, 1.2) ** 1.3 * 0.55
        + np.clip((np.abs(plane.y) - 6) / 5, 0, 1) * 0.35
    )
    white = white * np.exp(-pink[..., None] * np.array([0.05, 0.42, 0.42]))
    return np.asarray(white * np.exp(-np.clip(veins, 0, 1.2)[..., None] * np.array([0.09, 0.68, 0.65])))


def _veins(plane: _EyePlane) -> Array:
    """Conjunctival vessels wander from both corners towards the iris, branching and thinning."""
    rng = np.random.default_rng([plane.seed, 11])
    drawn = np.zeros((plane.size, plane.size), np.float32)
    for _ in range(46):
        angle, radius = rng.choice([0, np.pi]) + rng.normal(0, 0.55), rng.uniform(10.5, 15)
        start = radius * np.array([np.cos(angle), np.sin(angle)])
        _branch(
            drawn,
            rng,
            start,
            angle + np.pi + rng.normal(0, 0.4),
            rng.uniform(0.25, 0.9),
            int(rng.integers(25, 60)),
            0,
        )
    return np.asarray(
        gaussian_filter(drawn, plane.size / 2048) + 0.6 * gaussian_filter(drawn, plane.size / 512),
        dtype=float,
    )


def _branch(
    drawn: Field, rng: np.random.Generator, start: Array, heading: float, width: float, steps: int, depth: int
) -> None:
    at, points = start.copy(), [start.copy()]
    for _ in range(steps):
        to_centre = np.angle(np.exp(1j * (heading - np.arctan2(-at[1], -at[0]))))
        heading += rng.normal(0, 0.30) - 0.05 * float(to_centre)
        at = at + 0.16 * np.array([np.cos(heading), np.sin(heading)])
        if np.hypot(*at) < 6.5:
            break
        points.append(at)
        if depth < 3 and rng.random() < 0.06:
            turned = heading + rng.choice([-1, 1]) * rng.uniform(0.4, 0.9)
            _branch(drawn, rng, at, turned, width * 0.65, int(steps * 0.6), depth + 1)
    line = ((np.array(points) / EXTENT_MM + 0.5) * len(drawn) * 16).astype(np.int32)
    layer = np.zeros_like(drawn)
    cv2.polylines(layer, [line], False, float(width), 1 if width < 0.6 else 2, cv2.LINE_AA, 4)
    np.maximum(drawn, layer, out=drawn)
