"""Iris and sclera: albedo and relative height on the azimuthal equidistant plane of the eyeball."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from face_baking.eyes import TEXTURE_LIMIT
from face_baking.identity import Iris
from face_baking.kit import Array
from face_baking.sphere import IRIS_CM
from stimuli_builder.characters.colour import smooth

GLOBE_CM = 1.5
WHITE = (0.47, 0.43, 0.40)
VEINS = 60
DRIFT, DRIFT_CM = 0.006, 0.07
"""How far fibers wander on their way outwards: standard deviation at the rim, turns, and its scale, cm.

Straight spokes look drawn.
"""


class _Plane:
    """Coordinates of the texture in cm, and noise on it."""

    def __init__(self, size: int, rng: np.random.Generator) -> None:
        self.size, self.rng = size, rng
        self.px_per_cm = size / (2 * TEXTURE_LIMIT * GLOBE_CM)
        at = ((np.arange(size) + 0.5) / size * 2 - 1) * TEXTURE_LIMIT * GLOBE_CM
        self.x, self.y = np.meshgrid(at, at)
        self.r, self.angle = np.hypot(self.x, self.y), np.arctan2(self.y, self.x)
        self.drift = DRIFT * self.noise(DRIFT_CM)

    def noise(self, sigma_cm: float) -> Array:
        """Smooth noise of unit spread."""
        field = gaussian_filter(
            self.rng.normal(size=(self.size, self.size)), sigma_cm * self.px_per_cm, mode="wrap"
        )
        return np.asarray(field / field.std())

    def polar(self, around: int, outward: float, octaves: int, across: Array) -> Array:
        """Noise of so many cells round the pupil and outwards; fibres where there are many round it."""
        total = np.zeros_like(self.r)
        turn, out = self.angle / (2 * np.pi) + 0.5, np.clip(self.r / (IRIS_CM * 1.1), 0, 1)
        for k in range(octaves):
            columns, rows = around * 2**k, int(outward * 2**k) + 2
            grid = self.rng.normal(size=(rows + 3, columns))
            total += 0.62**k * _lookup(grid, out * rows, (turn + self.drift * across) * columns)
        return np.asarray(total / total[self.r < IRIS_CM].std())


@dataclass(frozen=True)
class White:
    """The eye's white of one person.

    Attributes
    ----------
    lightness : float
        Share of `WHITE`.
    redness : float
        Depth of its vessels and of what it reddens toward the corners, over the usual.
    """

    lightness: float = 1.0
    redness: float = 1.0


def white_of(melanin: float) -> White:
    """The white that looks right next to skin of an optical depth of melanin.

    One lightness for all was gray next to light skin, and shone by itself in dark skin, to which a camera
    gives more light.
    """
    lightness = float(np.interp(melanin, [0.17, 0.25, 0.52, 1.0], [1.55, 1.3, 0.85, 0.55]))
    return White(lightness, 1.25 if melanin > 0.9 else 1.0)


def eye_maps(
    iris: Iris, seed: int, sclera: White = White(), size: int = 1400
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(size, size, 3) linear albedo and (size, size) height in 0-1, lowest row first."""
    plane = _Plane(size, np.random.default_rng([seed, 7]))
    pupil = iris.pupil_mm / 20
    across = np.clip((plane.r - pupil) / (IRIS_CM - pupil), 0, 1)
    fibres, bundles = plane.polar(64, 1.2, 3, across), plane.polar(29, 1.6, 4, across)
    broad = plane.polar(8, 2, 3, across)
    coloured = _iris_colour(plane, iris, (fibres, bundles, broad), across)
    veins = _veins(plane)
    white = sclera.lightness * _sclera_colour(plane, veins, sclera.redness)
    limbus = IRIS_CM + 0.01
    blend = smooth(limbus - 0.08, limbus + 0.075, plane.r + 0.010 * broad)[..., None]
    ring = (1 - 0.14 * np.exp(-(((plane.r - limbus - 0.01) / 0.06) ** 2)))[..., None]
    albedo = coloured * (1 - blend) + white * blend * ring
    stroma = (plane.r < limbus) & (plane.r > pupil)
    height = np.where(
        plane.r > limbus,
        0.5 + 0.06 * plane.noise(0.06) + 0.06 * veins,
        0.5 + 0.05 * (fibres + bundles) * stroma,
    )
    return np.clip(albedo, 0, 1).astype(np.float32), np.clip(height, 0, 1).astype(np.float32)


def _iris_colour(plane: _Plane, iris: Iris, noises: tuple[Array, Array, Array], q: Array) -> Array:
    fibres, bundles, broad = noises
    pupil = iris.pupil_mm / 20
    outer, middle, inner = (np.array(c) for c in (iris.outer, iris.middle, iris.inner))
    zone = np.exp(-(((q - 0.45) / 0.35) ** 2))[..., None]
    # Uneven zones follow broad noise: where they follow the fibers' bundles they look like petals.
    core = np.clip(np.exp(-(((q - 0.08) / (0.24 + 0.02 * broad + 0.008 * bundles)) ** 2)) * 0.85, 0, 1)[
        ..., None
    ]
    # Here fibers lie bare, there a haze covers them: of one strength all round they were a wheel's spokes.
    bare = np.clip(0.75 + 0.45 * plane.noise(0.11), 0.15, 1.5)
    stroma = 0.66 + 0.19 * fibres * bare * (0.5 + 0.5 * q) + 0.10 * bundles + 0.13 * broad
    out = (outer * (1 - zone) + middle * zone) * (1 - core) + inner * core
    out = out * np.clip(stroma, 0.15, 1.6)[..., None] * 1.3
    collarette = np.exp(-(((q - (0.30 + 0.03 * broad + 0.012 * bundles)) / 0.13) ** 2))
    out *= (1 + 0.16 * collarette * np.clip(fibres, -0.5, 1))[..., None]
    for _ in range(26):
        radius = pupil + (IRIS_CM - pupil) * plane.rng.uniform(0.3, 0.7)
        turn = np.angle(np.exp(1j * (plane.angle - plane.rng.uniform(-np.pi, np.pi))))
        crypt = np.exp(-(np.hypot((plane.r - radius) / 0.04, turn * radius / 0.018) ** 3))
        out *= (1 - 0.5 * plane.rng.uniform(0.3, 1) * crypt)[..., None]
    out *= (1 - 0.55 * smooth(0.74, 1.03, q + 0.045 * broad))[..., None]
    out *= (1 - 0.6 * np.exp(-(((plane.r - pupil) / 0.018) ** 2)))[..., None]
    return np.where((plane.r < pupil + 0.003 * fibres)[..., None], 0.002, out)


def _sclera_colour(plane: _Plane, veins: Array, redness: float) -> Array:
    mottle = 0.05 * plane.noise(0.15) + 0.035 * plane.noise(0.03) + 0.05 * plane.noise(0.4)
    white = np.array(WHITE) * (1 + mottle)[..., None]
    aside = np.clip((np.abs(plane.x) - 0.60) / 0.6, 0, 1.3) ** 1.2 * 0.55
    pink = (aside + np.clip((np.abs(plane.y) - 0.6) / 0.5, 0, 1) * 0.5) * redness
    pink = pink * np.clip(1 + 0.35 * plane.noise(0.12), 0.2, 2)
    yellow = np.clip((np.abs(plane.x) - 0.5) / 0.5, 0, 1) * np.clip(1 + 0.4 * plane.noise(0.25), 0, 2)
    depth = pink[..., None] * np.array([0.10, 0.40, 0.44]) + yellow[..., None] * np.array([0.02, 0.05, 0.14])
    depth = depth + redness * veins[..., None] * np.array([0.10, 0.60, 0.56])
    return np.asarray(white * np.exp(-depth))


def _veins(plane: _Plane) -> Array:
    """(size, size) depth of vessels that wander from the corners toward the iris and branch."""
    ink = np.zeros((plane.size, plane.size))
    for _ in range(VEINS):
        turn = plane.rng.choice([0, np.pi]) + plane.rng.normal(0, 0.55)
        start = plane.rng.uniform(0.95, 1.6) * np.array([np.cos(turn), np.sin(turn)])
        width = plane.rng.uniform(0.15, 0.9)
        _branch(
            plane,
            ink,
            start,
            turn + np.pi + plane.rng.normal(0, 0.5),
            width,
            int(plane.rng.integers(25, 65)),
            0,
        )
    soft = 3.2 * gaussian_filter(ink, 0.8) + 2.2 * gaussian_filter(ink, 2.2)
    return np.asarray(np.clip(soft, 0, 1.0) * np.clip(0.55 + 0.5 * plane.noise(0.25), 0, 1))


def _branch(
    plane: _Plane, ink: Array, start: Array, heading: float, width: float, steps: int, generation: int
) -> None:
    rng, at = plane.rng, start
    for _ in range(steps):
        inwards = np.angle(np.exp(1j * (heading - np.arctan2(-at[1], -at[0]))))
        heading += rng.normal(0, 0.30) - 0.05 * inwards
        following = at + 0.016 * np.array([np.cos(heading), np.sin(heading)])
        if np.hypot(*following) < IRIS_CM + 0.06:
            return
        for share in np.linspace(0, 1, 4):
            row, column = ((at + share * (following - at))[::-1] * plane.px_per_cm + plane.size / 2).astype(
                int
            )
            if 0 <= row < plane.size and 0 <= column < plane.size:
                ink[row, column] += width
        at = following
        if generation < 3 and rng.random() < 0.08:
            aside = heading + rng.choice([-1, 1]) * rng.uniform(0.4, 0.9)
            _branch(plane, ink, at, aside, width * 0.6, int(steps * 0.6), generation + 1)


def _lookup(grid: Array, row: Array, column: Array) -> Array:
    """Smooth bilinear lookup, periodic in columns, clamped in rows."""
    i, j = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    a, b = row - i, column - j
    a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
    low, high = np.clip(i, 0, len(grid) - 1), np.clip(i + 1, 0, len(grid) - 1)
    left, right = j % grid.shape[1], (j + 1) % grid.shape[1]
    upper = (1 - b) * grid[low, left] + b * grid[low, right]
    return np.asarray((1 - a) * upper + a * ((1 - b) * grid[high, left] + b * grid[high, right]))
