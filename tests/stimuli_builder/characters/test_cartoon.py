"""The cartoon: its opening measured on pixels, its light, its levels."""

import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.characters.cartoon import LEVELS, OPENING_MM, crop_px, draw_frame, fingerprint
from stimuli_builder.characters.cartoon_eye import margins
from stimuli_builder.characters.cartoon_pen import CARTOON, WILLOW, CartoonLook
from stimuli_builder.clips.character_levels import CARTOON_2, DRAWN_LOOKS, CartoonCharacter
from stimuli_builder.clips.characters import DRAWN

SIZE = (1920, 720)
PX_PER_MM = 15.0


def eye_window(side: int) -> tuple[int, int, int, int]:
    """One eye from canthus to canthus: x, y, width, height in px at SIZE."""
    middle = 960 + round(side * 30 * PX_PER_MM)
    return middle - 150, 260, 300, 260


def visible_opening_mm(picture: np.ndarray) -> float:
    """Height of the highest column of eyeball in a picture (h, w, 3).

    All colors of the eyeball have nearly as much green as red, or more; skin, lashes and rims have less.
    """
    eyeball = picture[..., 1] > 0.84 * picture[..., 0]
    return float(np.max(eyeball.sum(0)) / PX_PER_MM)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("closure", [0.0, 0.1, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0])
def test_the_visible_opening_is_calibrated(side: int, closure: float) -> None:
    opening = visible_opening_mm(draw_frame(closure, SIZE, eye_window(side)))
    assert opening == pytest.approx(OPENING_MM * (1 - closure), abs=0.1)


def test_both_eyes_are_lit_from_the_same_side() -> None:
    for side in (-1, 1):
        picture = draw_frame(0.0, SIZE, eye_window(side)).min(axis=2)
        light = np.argwhere(picture > 0.97)
        assert light[:, 1].mean() < 150
    skin = draw_frame(0.0, (960, 360)).mean(axis=(0, 2))
    assert skin[:100].mean() > skin[-100:].mean() + 0.05


def test_the_eyes_are_not_mirror_images() -> None:
    picture = draw_frame(0.0, (960, 360))
    assert np.abs(picture[100:260, :480] - picture[100:260, :479:-1]).mean() > 0.01


def test_only_the_crop_changes() -> None:
    x, y, width, height = crop_px((960, 360))
    changed = np.any(draw_frame(0.0, (960, 360)) != draw_frame(1.0, (960, 360)), axis=2)
    assert changed.any()
    changed[y : y + height, x : x + width] = False
    assert not changed.any()


def test_a_window_is_the_same_part_of_the_whole() -> None:
    whole = draw_frame(0.3, (960, 360))
    part = draw_frame(0.3, (960, 360), (100, 60, 400, 200))
    # Edges are anti-aliased from another origin: less than one code value.
    np.testing.assert_allclose(part, whole[60:260, 100:500], atol=1 / 255)


@pytest.mark.parametrize("closure", [0.05, 0.5, 0.95])
def test_levels_are_close_enough_to_interpolate(closure: float) -> None:
    window = crop_px((960, 360))
    step = 1 / (LEVELS - 1)
    low = np.floor(closure / step) * step
    pictures = [draw_frame(w, (960, 360), window).astype(float) for w in (low, low + step / 2, low + step)]
    between = ((pictures[0] ** 2.2 + pictures[2] ** 2.2) / 2) ** (1 / 2.2)
    mse = np.mean((between - pictures[1]) ** 2)
    assert -10 * np.log10(mse) > 44


@pytest.mark.parametrize("closure", [-0.01, 1.01, float("nan")])
def test_closure_outside_its_range_is_refused(closure: float) -> None:
    with pytest.raises(InputError, match="closure must lie between"):
        draw_frame(closure, (320, 120))


def test_every_look_is_a_character() -> None:
    """The names stand apart from the looks, which need the drawing library."""
    assert tuple(DRAWN_LOOKS) == DRAWN


def test_each_drawing_has_its_own_fingerprint() -> None:
    prints = [CartoonCharacter(look).fingerprint for look in (CARTOON, WILLOW, CARTOON_2)]
    assert [len(one) for one in prints] == [64, 64, 64]
    assert len(set(prints)) == 3
    # A study's clips of the first one are known by it.
    assert prints[0] == fingerprint(CARTOON)


def white_mm(closure: float, side: int, look: CartoonLook) -> float:
    """Height of the white of one eye in the column 8 mm to the temple."""
    x = 960 + round(side * 38 * PX_PER_MM)
    column = draw_frame(closure, SIZE, (x, 260, 1, 260), look)[:, 0]
    # Bluish next to skin, lashes and rims, all of which are brown.
    return float((column[:, 2] > 0.8 * column[:, 0]).sum() / PX_PER_MM)


@pytest.mark.parametrize("look", [WILLOW, CARTOON_2], ids=lambda look: look.name)
@pytest.mark.parametrize("closure", [0.15, 0.3, 0.5, 0.6])
def test_eyes_of_which_one_leads_open_as_declared_in_the_mean(closure: float, look: CartoonLook) -> None:
    opened, now = (np.array([white_mm(c, side, look) for side in (-1, 1)]) for c in (0.0, closure))
    shares = now / opened
    assert shares.mean() == pytest.approx(1 - closure, abs=0.025)
    assert shares[1] - shares[0] == pytest.approx(0.05 * np.sin(np.pi * closure), abs=0.025)


@pytest.mark.parametrize("look", [CARTOON, WILLOW, CARTOON_2], ids=lambda look: look.name)
def test_nothing_of_the_iris_glows_between_lids_that_nearly_touch(look: CartoonLook) -> None:
    """The first drawing keeps its line of iris: studies have its clips."""
    (left, _), closure = look.eyes, 0.93
    x, upper, lower = margins(left, closure)
    picture = draw_frame(closure, SIZE, look=look)
    at = np.flatnonzero(np.abs(x) < 4)
    rows = 360 - ((upper[at] + lower[at]) / 2 + left.centre_y_mm - 3.5) * PX_PER_MM
    columns = 960 + (-30 - x[at]) * PX_PER_MM
    brightest = picture[rows.round().astype(int), columns.round().astype(int)].max()
    assert (brightest < 0.25) == look.darkens
