"""Single wrong pixels of a layer of hair have their neighbors' light; all others stay."""

import numpy as np
import pytest
from face_baking.hair_light import without_dots, without_specks

BROWN = np.array([0.06, 0.035, 0.02], np.float32)


def layer(cover: float = 0.6) -> np.ndarray:
    """A field of brown hair of that coverage, each pixel a little lighter or darker."""
    shade = np.random.default_rng(8).uniform(0.7, 1.3, (20, 30, 1))
    light = BROWN * shade * cover
    return np.concatenate([light, np.full((20, 30, 1), cover)], axis=-1).astype(np.float32)


def test_a_layer_without_wrong_pixels_stays_as_it_is() -> None:
    hair = layer()
    hair[:, :6] = 0  # skin without hair
    assert np.array_equal(without_specks(hair), hair)


@pytest.mark.parametrize("place", [(7, 11), (0, 0), (19, 29)])
def test_a_pixel_black_and_whole_gets_light_and_coverage_of_those_about_it(place: tuple[int, int]) -> None:
    hair = layer()
    hair[place] = (0, 0, 0, 1)
    mended = without_specks(hair)
    assert mended[place][3] == pytest.approx(0.6)
    assert mended[place][:3] == pytest.approx(BROWN * 0.6, rel=0.2)
    others = np.ones((20, 30), bool)
    others[place] = False
    assert np.array_equal(mended[others], hair[others])


def test_a_glaring_pixel_keeps_its_coverage_and_loses_its_glare() -> None:
    hair = layer()
    hair[9, 9] = (2.0, 2.0, 2.0, 0.5)
    assert without_specks(hair)[9, 9] == pytest.approx([*(BROWN * 0.5), 0.5], rel=0.25)


def test_the_tip_of_a_hair_that_ends_alone_stays() -> None:
    hair = np.zeros((9, 9, 4), np.float32)
    hair[4, 2:6] = (*(BROWN * 0.3), 0.3)
    assert np.array_equal(without_specks(hair), hair)


def test_a_lone_pixel_of_hair_has_nothing_to_be_held_against_and_stays() -> None:
    hair = np.zeros((9, 9, 4), np.float32)
    hair[4, 4] = (*(BROWN * 0.2), 0.2)
    assert np.array_equal(without_specks(hair), hair)


def test_neighbouring_broken_pixels_take_from_those_that_are_whole() -> None:
    hair = layer()
    hair[5, 5] = hair[5, 6] = (0, 0, 0, 1)
    assert without_specks(hair)[5, 5:7, 3] == pytest.approx([0.6, 0.6])


def skin_with_a_lash() -> tuple[np.ndarray, np.ndarray]:
    """Light skin, a little uneven, with one dark hair of a pixel's width across it, and its coverage."""
    shade = np.random.default_rng(3).uniform(0.9, 1.1, (15, 20, 1))
    cover = np.zeros((15, 20), np.float32)
    cover[range(3, 12), range(4, 13)] = 0.85
    picture = np.array([0.3, 0.18, 0.12]) * shade * (1 - cover[..., None])
    return picture.astype(np.float32), cover


def test_a_dark_dot_on_skin_goes_and_a_lash_stays_but_for_its_last_pixels() -> None:
    picture, cover = skin_with_a_lash()
    dotted, covered = picture.copy(), cover.copy()
    for dot in ((2, 15), (13, 2)):
        dotted[dot], covered[dot] = (0.01, 0.005, 0.003), 1.0
    mended = without_dots(dotted, covered)
    for dot in ((2, 15), (13, 2)):
        assert mended[dot] == pytest.approx(picture[dot], rel=0.15)
    inner = (slice(4, 11), slice(5, 12))
    assert np.array_equal(mended[inner], picture[inner])
    for end in ((3, 4), (11, 12)):
        assert mended[end].min() > picture[end].max()


def test_a_thin_lash_of_uneven_coverage_is_not_broken_into_specks() -> None:
    """As sampled: every other pixel of it is half as dark as the next, and none of them is a dot."""
    picture, cover = skin_with_a_lash()
    along = np.arange(9)
    cover[along + 3, along + 4] = np.where(along % 2, 0.9, 0.45)
    picture[along + 3, along + 4] *= ((1 - cover) / 0.15)[along + 3, along + 4, None]
    assert np.array_equal(without_dots(picture, cover), picture)


def test_a_dot_in_the_corner_goes_too() -> None:
    picture, cover = skin_with_a_lash()
    picture[0, 19], cover[0, 19] = 0, 1
    assert without_dots(picture, cover)[0, 19].min() > 0.1


def test_what_hair_does_not_cover_stays_however_dark() -> None:
    picture = np.full((20, 20, 3), 0.1, np.float32)
    picture[5:9, 5:9] = 5.0
    picture[12:18, 3:9] = picture[2, 15] = 0.001
    assert np.array_equal(without_dots(picture, np.zeros((20, 20), np.float32)), picture)
