"""Planes of brightness and differences of colours: their formula, and that nothing is lost in them."""

from pathlib import Path

import numpy as np
from face_baking.development import psnr_db
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stimuli_builder.characters.atlas import decode_level_video, write_level_video
from stimuli_builder.characters.colour import picture_of, planes_of

CORNERS = np.array([[[r, g, b] for r in (0, 255) for g in (0, 255) for b in (0, 255)]], np.uint8)


@given(arrays(np.uint8, (3, 4, 3), elements=st.integers(0, 255)))
def test_every_picture_comes_back_to_the_code_value(picture: np.ndarray) -> None:
    planes = planes_of(picture)
    assert all(plane.max() < 1024 for plane in planes)
    np.testing.assert_array_equal(picture_of(planes), picture)


def test_corners_of_the_cube_of_colours() -> None:
    np.testing.assert_array_equal(picture_of(planes_of(CORNERS)), CORNERS)
    red = [int(plane[0, 4]) for plane in planes_of(CORNERS)]
    assert red == [255, 512 - 255, 512 + 510]


def test_planes_beyond_any_colour_end_at_the_nearest_code_values() -> None:
    beyond = tuple(np.full((1, 1), value, np.uint16) for value in (1023, 1023, 0))
    assert picture_of(beyond).ravel().tolist() == [0, 255, 255]


def test_saturated_colours_survive_the_video(tmp_path: Path) -> None:
    """Ten bits hold the greatest differences of colours, which eight would cut."""
    picture = np.repeat(np.repeat(CORNERS, 24, 1), 48, 0)
    write_level_video(tmp_path, "corners.mkv", [picture, picture])
    frames = decode_level_video((tmp_path / "corners.mkv").read_bytes(), "levels", "corners.mkv")
    assert psnr_db(frames[1], picture) > 45
