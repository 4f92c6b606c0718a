"""The lids' geometry: the visible fissure follows closure, and the lower lid moves on its own."""

import numpy as np
import pytest

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose, build_skin
from stimuli_builder.characters.photorealistic.framing import Frame
from stimuli_builder.characters.photorealistic.hair import brow, lashes
from stimuli_builder.characters.photorealistic.parameters import Face, load_preset
from stimuli_builder.characters.photorealistic.visibility import EYE, UPPER_LASH, Surface, surface, view

FRAME = Frame(960, 360)


def visible_opening_mm(face: Face, closure: float, side: int) -> float:
    """Tallest run of eyeball pixels over all columns, in mm on the screen, lashes left out."""
    seen = surface(face, build_skin(LidPose(closure)), side)
    skin = seen.kind < UPPER_LASH
    skin_only = Surface(seen.points[skin], seen.kind[skin])
    box = FRAME.eye_boxes()["left" if side < 0 else "right"]
    eye = view(skin_only, FRAME, box).kind == EYE
    return float(eye.sum(0).max() / FRAME.px_per_mm)


@pytest.mark.parametrize("closure", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_visible_fissure_is_11_mm_times_what_is_left(closure: float, side: int) -> None:
    opening = visible_opening_mm(load_preset("northern"), closure, side)
    assert opening == pytest.approx(11.0 * (1 - closure), abs=0.3)


def test_open_fissure_is_zero_at_the_canthi_and_11_mm_at_most() -> None:
    local = np.linspace(-20, 20, 400)
    height = anatomy.open_fissure(local)
    assert height.max() == pytest.approx(11.0, abs=0.01)
    assert not height[~anatomy.inside_fissure(local)].any()


def test_upper_lid_does_not_follow_the_lower() -> None:
    still, moved = build_skin(LidPose(0.3)), build_skin(LidPose(0.3, 1.0, 5.0))
    np.testing.assert_array_equal(still.edges.upper_front, moved.edges.upper_front)


def test_lower_lid_lifts() -> None:
    still, moved = build_skin(LidPose(0.3)).edges, build_skin(LidPose(0.3, 1.0)).edges
    lift = moved.lower_front - still.lower_front
    assert lift[:, 1].max() == pytest.approx(1.0, abs=0.01)
    assert lift[:, 1].min() >= 0
    np.testing.assert_array_equal(lift[:, 0], 0)


def test_lower_lid_slides_along_its_own_outline_without_folding() -> None:
    still, moved = build_skin(LidPose(0.3)).edges, build_skin(LidPose(0.3, 0.0, 5.0)).edges
    nasal = -np.sign(still.x) * (moved.lower_front - still.lower_front)[:, 0]
    assert nasal.max() == pytest.approx(5.0, abs=0.01)
    assert nasal.min() >= 0
    assert np.diff(moved.lower_front[:, 0]).min() > 0
    outline = np.interp(moved.lower_front[:, 0], still.x, still.lower_front[:, 1])
    np.testing.assert_allclose(moved.lower_front[:, 1], outline, atol=0.03)


def test_skin_beyond_the_lids_stays_where_it_is() -> None:
    opened, closed = build_skin(LidPose(0.0)), build_skin(LidPose(1.0))
    far = np.abs(opened.uv[:, 1] * 100 - 50) > 40
    np.testing.assert_allclose(opened.vertices[far], closed.vertices[far], atol=0.05)


def test_mesh_is_whole() -> None:
    skin = build_skin(LidPose(0.5))
    assert np.isfinite(skin.vertices).all()
    assert skin.quads.max() < len(skin.vertices)
    assert 0 <= skin.uv[:, 0].min() < skin.uv[:, 0].max() <= 1


def test_lashes_ride_on_the_lid_and_stay_the_same_hairs() -> None:
    hair = load_preset("northern").hair
    opened, half = (lashes(build_skin(LidPose(w)).edges, 1, hair, 3)[0] for w in (0.0, 0.5))
    assert len(opened) == hair.upper_lashes
    fall = np.array([a[0][0, 1] - b[0][0, 1] for a, b in zip(opened, half, strict=True)])
    assert fall.max() == pytest.approx(5.5, abs=0.6)
    assert [radius for _, radius in opened] == [radius for _, radius in half]


def test_brow_is_the_same_at_every_bake_and_differs_between_sides() -> None:
    hair = load_preset("northern").hair
    left, again, right = brow(-1, hair, 7), brow(-1, hair, 7), brow(1, hair, 9)
    np.testing.assert_array_equal(left[5][0], again[5][0])
    assert np.mean([s[0][0, 1] for s in left]) > np.mean([s[0][0, 1] for s in right])
