"""Textures are drawn from the declared face: the same again, and darker skin for more melanin."""

import numpy as np
import pytest

from stimuli_builder.characters.photorealistic.eye_texture import eye_maps
from stimuli_builder.characters.photorealistic.noise import Plane
from stimuli_builder.characters.photorealistic.parameters import Iris, Skin
from stimuli_builder.characters.photorealistic.skin_texture import SkinMaps, skin_maps


def draw(melanin: float = 1.0, age_lines: float = 0.5) -> SkinMaps:
    skin = Skin(melanin=melanin, haemoglobin=1.0, freckles=20, age_lines=age_lines)
    return skin_maps(Plane(2, 7), skin)


def test_skin_is_drawn_the_same_again() -> None:
    first, second = draw(), draw()
    np.testing.assert_array_equal(first.albedo, second.albedo)
    np.testing.assert_array_equal(first.height_mm, second.height_mm)


def test_melanin_darkens_and_age_lines_deepen() -> None:
    fair, brown, old = draw(), draw(melanin=2.5), draw(age_lines=2.0)
    assert brown.albedo.mean() < 0.7 * fair.albedo.mean()
    assert old.height_mm.min() < fair.height_mm.min()
    np.testing.assert_array_equal(old.albedo, fair.albedo)


def test_maps_stay_within_their_ranges() -> None:
    maps = draw()
    assert maps.albedo.shape == (200, 320, 3)
    assert 0 < maps.albedo.min() <= maps.albedo.max() <= 0.95
    assert 0.2 <= maps.roughness.min() <= maps.roughness.max() <= 0.8


def test_noise_has_unit_deviation() -> None:
    assert Plane(4, 1).octaves(3, 10, 3).std() == pytest.approx(1, abs=1e-3)


def test_iris_has_the_declared_colour_and_a_black_pupil() -> None:
    iris = Iris(outer=(0.1, 0.2, 0.4), middle=(0.1, 0.2, 0.4), inner=(0.1, 0.2, 0.4))
    albedo, height = eye_maps(iris, 3, size=256)
    middle = 128
    assert albedo[middle - 2 : middle + 2, middle - 2 : middle + 2].max() < 0.01
    ring = albedo[middle, middle + round(3.8 / 48.8 * 256)]
    assert ring[2] > ring[1] > ring[0]
    assert height.shape == (256, 256)
