"""Skin as three maps over the texture plane: albedo, height in mm, roughness."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.curves import bell, step
from stimuli_builder.characters.photorealistic.hair import brow_half_height, brow_line
from stimuli_builder.characters.photorealistic.noise import Field, Plane
from stimuli_builder.characters.photorealistic.parameters import Skin

# Absorption per unit of melanin and haemoglobin in red, green, blue, fitted by eye to photographs.
MELANIN_RGB, HAEMOGLOBIN_RGB = (0.20, 0.36, 0.56), (0.045, 0.27, 0.22)
BASE_RGB = (0.736, 0.444, 0.330)


@dataclass(frozen=True)
class SkinMaps:
    """(rows, columns[, 3]) maps, lowest row first: linear albedo, height in mm, roughness 0-1."""

    albedo: Field
    height_mm: Field
    roughness: Field


class _Regions:
    """Where things are on the face, in mm of the texture plane."""

    def __init__(self, plane: Plane) -> None:
        self.across = np.abs(plane.x)
        self.local = self.across - anatomy.EYE_X_MM
        self.above = plane.y - anatomy.closure_line(self.local)
        within = np.clip(1 - np.maximum(np.abs(self.local + 0.8) - 13.5, 0) / 3, 0, 1)
        self.within = within
        self.upper_lid = within * step(-0.2, 0.5, self.above) * step(15, 7, self.above)
        self.lower_lid = within * step(0.2, -0.5, self.above) * step(-12, -5, self.above)
        self.lids = np.clip(self.upper_lid + self.lower_lid, 0, 1)
        bag = bell((self.above + 7) / 7, 1) * bell(self.local / 13, 1)
        pores = (
            0.25
            + bell(self.across, 13) * step(14, -6, plane.y)
            + 0.5 * bell(plane.y - 26, 8) * bell(self.across, 20)
        )
        pores = pores + 0.8 * bell(plane.y + 24, 11) * step(70, 40, self.across)
        self.porous = np.clip(pores, 0, 1.2) * (1 - 0.9 * self.lids) * (1 - 0.8 * bag)


def skin_maps(plane: Plane, skin: Skin) -> SkinMaps:
    """Draw the skin of a face; the plane's seed decides every random detail."""
    regions = _Regions(plane)
    near, second, _ = plane.cells(0.42, 1)
    furrow = second - near
    near, _, label = plane.cells(0.95, 3)
    pore = np.exp(-((near / (0.10 + 0.07 * label)) ** 2)) * (label > 0.25) * regions.porous
    height = _fine_relief(plane, regions, furrow, pore) + _creases(plane, regions) * skin.age_lines
    melanin, redness = _pigments(plane, regions, pore, furrow)
    _add_spots(plane, melanin, redness, skin.freckles)
    veins, blue = _vessels(plane)
    redness = (redness + 0.5 * veins) * skin.haemoglobin
    # Darker skin is not blotchier: what varies from place to place grows more slowly than the mean.
    extra_melanin = skin.melanin - 1 + (melanin - 1) * skin.melanin**-0.3
    absorbed = extra_melanin[..., None] * np.array(MELANIN_RGB, np.float32)
    absorbed = absorbed + (redness - 1)[..., None] * np.array(HAEMOGLOBIN_RGB, np.float32)
    albedo = np.array(BASE_RGB, np.float32) * np.exp(-absorbed)
    albedo = albedo * (1 - 0.10 * blue[..., None] * np.array([1, 0.6, 0.3], np.float32))
    roughness = (
        0.42 + 0.05 * plane.octaves(1.5, 200, 3) - 0.09 * bell(regions.across, 9) * step(16, 0, plane.y)
    )
    roughness = roughness - 0.05 * bell(plane.y - 30, 9) + 0.03 * plane.noise(0.2, 210) + 0.05 * pore
    roughness = roughness + 0.09 * regions.upper_lid + 0.06 * regions.lower_lid
    return SkinMaps(
        np.clip(albedo, 0.01, 0.95).astype(np.float32),
        height.astype(np.float32),
        np.clip(roughness, 0.2, 0.8).astype(np.float32),
    )


def _fine_relief(plane: Plane, regions: _Regions, furrow: Field, pore: Field) -> Field:
    """Furrow net, pores, low unevenness and the fine lines of both lids, in mm."""
    near, second, _ = plane.cells(0.95, 2, (1.25, 0.85))
    height = -0.016 * np.exp(-((furrow / 0.06) ** 2)) - 0.055 * pore
    height -= 0.022 * (1 - 0.55 * regions.lids) * np.exp(-(((second - near) / 0.09) ** 2))
    height += 0.032 * plane.octaves(2.2, 20, 3) + 0.05 * plane.noise(4.5, 33)
    wave = regions.above + 0.35 * plane.noise(3.5, 41) + 0.10 * plane.noise(1.0, 42)
    lines = np.clip(np.cos(2 * np.pi * wave / 0.75 + 1.2 * plane.noise(4, 43)) - 0.15, 0, 1)
    height -= 0.018 * regions.upper_lid * np.clip(0.6 * plane.noise(2.0, 44, 1.6) + 0.6, 0, 1.3) * lines
    wave = regions.above + 0.16 * regions.local + 0.45 * plane.noise(3.0, 51) + 0.08 * plane.noise(0.8, 52)
    lines = np.clip(np.cos(2 * np.pi * wave / 1.15) - 0.3, 0, 1)
    where = regions.within * step(-1.2, -3, regions.above) * step(-15, -7, regions.above)
    height -= 0.022 * lines * np.clip(0.6 * plane.noise(2.5, 54, 1.5) + 0.55, 0, 1.3) * where
    return np.asarray(height, dtype=np.float32)


def _crease(distance: Field, width: float, depth: float, where: Field) -> Field:
    """A groove with raised banks along distance 0."""
    groove = -depth * np.exp(-((distance / width) ** 2))
    banks = 0.45 * depth * np.exp(-(((np.abs(distance) - 2 * width) / (1.4 * width)) ** 2))
    return np.asarray((groove + banks) * where, dtype=np.float32)


def _creases(plane: Plane, regions: _Regions) -> Field:
    """The lines that come with age: under the eyes, crow's feet, glabella, nasal root, upper-lid folds."""
    local, above, y = regions.local, regions.above, plane.y
    wavy = 0.25 * plane.noise(3, 61) + 0.08 * plane.noise(0.9, 62)
    total = np.zeros(plane.shape, np.float32)
    reach = step(-15, -8, local) * step(16, 4, local) * np.clip(0.65 + 0.4 * plane.noise(4, 63), 0, 1)
    for offset, depth in ((5.2, 0.05), (7.4, 0.035), (9.6, 0.02)):
        total += _crease(above + offset + wavy - 0.0024 * (local + 4) ** 2, 0.30, depth, reach)
    for degrees, depth in ((26, 0.010), (11, 0.022), (-5, 0.028), (-19, 0.022), (-34, 0.012)):
        total += _crow_foot(plane, regions, degrees, depth)
    brow_gap = regions.across - 6.5 - 0.001 * (y - 18) ** 2 + wavy
    total += _crease(brow_gap, 0.5, 0.05, step(11, 15, y) * step(28, 21, y))
    for level, bend, depth in ((7.0, 0.02, 0.018), (10.0, 0.015, 0.014)):
        total += _crease(
            y - level - bend * regions.across**2 + 2 * wavy, 0.5, depth, step(7, 3, regions.across)
        )
    fold = anatomy.fold_crest(local) - anatomy.closure_line(local) - anatomy.open_fissure(local) - 1.5
    reach = regions.upper_lid * step(-13, -8, local) * step(13, 9, local)
    for offset, depth in ((3.2, 0.07), (4.6, 0.05), (6.2, 0.045)):
        total += _crease(above - fold - offset + 0.2 * plane.noise(4, 90), 0.28, depth, reach)
    return total


def _crow_foot(plane: Plane, regions: _Regions, degrees: int, depth: float) -> Field:
    dx, dy = regions.local - 14.0, plane.y - 0.6 - 0.024 * degrees
    r, angle = np.hypot(dx, dy), np.degrees(np.arctan2(dy, dx))
    bend = 0.54 * r * np.sign(degrees + 0.1)
    distance = r * np.sin(np.radians(angle - degrees - bend))
    distance = distance + 0.55 * plane.noise(3.0, 570 + degrees) + 0.15 * plane.noise(0.8, 670 + degrees)
    patchy = np.clip(0.6 + 0.5 * plane.noise(3, 770 + degrees), 0, 1.3)
    return _crease(distance, 0.38, depth, patchy * step(2.5, 6, r) * step(20, 10, r) * (dx > 0))


def _pigments(plane: Plane, regions: _Regions, pore: Field, furrow: Field) -> tuple[Field, Field]:
    """Melanin and haemoglobin, 1 on average cheek."""
    local, above, across, y = regions.local, regions.above, regions.across, plane.y
    melanin = (
        1
        + 0.07 * plane.octaves(9, 100, 4)
        + 0.10 * plane.octaves(1.4, 110, 3)
        + 0.07 * plane.noise(0.22, 115)
    )
    redness = (
        1 + 0.09 * plane.octaves(7, 120, 4) + 0.17 * plane.octaves(1.4, 130, 3) + 0.10 * plane.noise(0.3, 135)
    )
    redness += 0.50 * bell(across, 10) * step(6, -16, y) + 0.5 * bell(across - 38, 16) * bell(y + 22, 9)
    # The lid above the lashes: mottled and sallow rather than one pink strip.
    mottled = np.clip(1 + 0.55 * plane.octaves(1.1, 150, 3) + 0.4 * plane.noise(3, 155), 0, 2.2)
    redness += (0.20 * step(9, 3, above) * mottled - 0.42 * step(5.5, 0.8, above)) * regions.upper_lid
    melanin += regions.upper_lid * step(5.5, 0.8, above) * (0.16 + 0.16 * mottled)
    redness += 0.38 * regions.lower_lid * step(-6, -0.5, above)
    redness += 0.7 * bell(local + 14.5, 4) * bell(y + 2, 4) + 0.35 * bell(local - 13.5, 3) * bell(y, 3)
    redness += 0.30 * bell(above + 8, 4) * bell(local + 5, 10)
    melanin += 0.22 * bell(above + 8.5, 4) * bell(local + 3, 11) + 0.18 * bell(local + 15, 6) * bell(y - 1, 7)
    melanin += 0.25 * step(19, 10, above) * step(-1, 1, above) * bell(local - 1, 13) - 0.12 * bell(y - 30, 9)
    ends = np.clip(1 - np.maximum(np.abs(local - 0.5) - 12, 0) / 1.5, 0, 1)
    melanin += (1.1 * bell(above - 0.2, 0.32) * (above > -0.3) + 0.35 * bell(above + 0.5, 0.35)) * ends
    along = np.clip((across - 13.5) / 42, 0, 1)
    stubble = np.exp(-(np.abs((y - brow_line(along)) / (brow_half_height(along) * 1.1)) ** 3))
    stubble = stubble * step(11.5, 17, across) * step(57, 50, across)
    melanin += 0.85 * stubble * (1 + 0.3 * plane.noise(0.5, 140))
    melanin += 0.22 * pore + 0.06 * np.exp(-((furrow / 0.07) ** 2))
    return np.asarray(melanin, np.float32), np.asarray(redness + 0.30 * pore, np.float32)


def _add_spots(plane: Plane, melanin: Field, redness: Field, freckles: int) -> None:
    """Freckles, a mole or two and faint pimples, added in place."""
    rng = np.random.default_rng([plane.seed, 500])
    for index in range(freckles):
        x, y, radius = rng.uniform(-70, 70), rng.uniform(-45, 40), rng.lognormal(-1.3, 0.42)
        strength = rng.uniform(0.05, 0.32) * (
            1 + 0.8 * np.exp(-(((abs(x) - 28) / 16) ** 2) - ((y + 20) / 10) ** 2)
        )
        if rng.random() < 0.012 and abs(abs(x) - 30) > 16:
            radius, strength = 0.55, 1.2
        _add_spot(plane, melanin, (x, y), radius, strength, index)
    for index in range(22):
        x, y = rng.uniform(-65, 65), rng.uniform(-40, 38)
        if abs(abs(x) - 30) > 16 or abs(y) > 12:
            _add_spot(plane, redness, (x, y), rng.uniform(0.3, 0.9), rng.uniform(0.2, 0.6), index)


def _add_spot(
    plane: Plane, field: Field, at: tuple[float, float], radius: float, strength: float, turn: int
) -> None:
    column, row = plane.to_px(np.array([at]))[0]
    reach = int(4 * radius * plane.px_per_mm) + 2
    rows = slice(max(row - reach, 0), max(row + reach, 0))
    columns = slice(max(column - reach, 0), max(column + reach, 0))
    dx, dy = plane.x[rows, columns] - at[0], plane.y[rows, columns] - at[1]
    angle = np.arctan2(dy, dx)
    outline = 1 + 0.35 * np.cos(2 * angle + turn) + 0.2 * np.cos(3 * angle + 2 * turn)
    field[rows, columns] += strength * np.exp(-(((dx**2 + dy**2) / (radius**2 * outline)) ** 1.3))


def _vessels(plane: Plane) -> tuple[Field, Field]:
    """Capillaries (reddening) and the faint blue veins of the upper lid, each 0-1."""
    rng = np.random.default_rng([plane.seed, 600])
    fine, broad = np.zeros(plane.shape, np.float32), np.zeros(plane.shape, np.float32)
    for _ in range(90):
        side = rng.choice([-1, 1])
        high = rng.random() < 0.75
        start = (side * (30 + rng.normal(0, 13)), rng.normal(-3, 11) if high else rng.normal(-22, 6))
        _walk(plane, fine, start, int(rng.integers(15, 60)), 0.22, 0.35, float(rng.uniform(0.2, 0.8)), rng)
    for side in (-1, 1):
        for _ in range(5):
            start = (side * (30 + rng.uniform(-14, 6)), rng.uniform(2, 8))
            _walk(plane, broad, start, 40, 0.27, 0.2, 1.0, rng)
    sigma = plane.px_per_mm / 16
    return np.asarray(gaussian_filter(fine, 1.3 * sigma)), np.asarray(gaussian_filter(broad, 6 * sigma))


def _walk(
    plane: Plane, field: Field, start: tuple[float, float], steps: int, step_mm: float, turn: float,
    strength: float, rng: np.random.Generator,
) -> None:  # fmt: skip
    angle = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(0, turn, steps))
    points = np.array(start) + step_mm * np.cumsum(np.stack([np.cos(angle), np.sin(angle)], -1), axis=0)
    thickness = 1 if turn > 0.3 else max(1, round(0.35 * plane.px_per_mm))
    cv2.polylines(field, [plane.to_px(points)], False, strength, thickness, cv2.LINE_AA)
