"""Inputs of the skin's shader about the upper lids: where its texture is, and how they shine."""

import numpy as np
import pytest
from face_baking.blink_path import BlinkPath, nasal_tip
from face_baking.framing import FRAMINGS
from face_baking.identity import identity_of_seed
from face_baking.kit import FaceKit
from face_baking.lid_coordinates import LID_MIDDLE
from face_baking.lid_loops import chains
from face_baking.lid_relief import MOUND_RISE_CM
from face_baking.lid_skin import FaceSkin, face_part, lid_skin, normals
from face_baking.pigments import Pigments
from face_baking.subdivision import subdivide
from numpy.typing import NDArray

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def skin(kit: FaceKit) -> FaceSkin:
    identity = identity_of_seed(4)
    return lid_skin(BlinkPath(kit, identity.rest(kit), identity.movement), identity, levels=2, loops=14)


@pytest.fixture(scope="module")
def values(skin: FaceSkin) -> dict[str, Array]:
    return Pigments(skin).values()


def on_lid(skin: FaceSkin) -> NDArray[np.bool_]:
    """Vertices on the middle of the upper lids' skin."""
    at = skin.coordinates
    return (at.upper > 0.95) & (at.loop > 4.6) & (at.loop < 8) & (np.abs(at.azimuth) < 0.6)


def lengths(skin: FaceSkin, points: Array) -> Array:
    """Lengths of the edges between vertices of the upper lids."""
    quads = skin.fine.quads[on_lid(skin)[skin.fine.quads].all(axis=1)]
    return np.asarray(np.linalg.norm(points[quads] - points[np.roll(quads, 1, axis=1)], axis=-1).ravel())


def test_texture_is_not_drawn_out_on_the_shut_lid(skin: FaceSkin, values: dict[str, Array]) -> None:
    shut = lengths(skin, skin.at(1.0))
    # Of the open lid it was up to six times as high when shut, and any grain in it a streak.
    assert np.percentile(shut / lengths(skin, skin.rest), 95) > 2.5
    for name in ("rest", "warp"):
        least, most = np.percentile(shut / lengths(skin, values[name]), (5, 95))
        assert least > 0.6, name
        assert most < 1.6, name


def test_the_upper_lid_is_duller_and_darker_than_the_skin_beyond(
    skin: FaceSkin, values: dict[str, Array]
) -> None:
    lid, beyond = on_lid(skin), skin.coordinates.loop > 12.9
    assert values["shine"][lid].max() < 0.5
    assert values["shine"][beyond].min() == 1.0
    assert values["rough"][lid].mean() - values["rough"][beyond].mean() > 0.04
    assert values["mel"][lid].mean() > 1.15 * values["mel"][beyond & (skin.coordinates.upper < 0.5)].mean()


def test_the_wet_margins_blood_gathers_towards_the_corners(skin: FaceSkin) -> None:
    outer, blood = np.abs(skin.coordinates.azimuth - LID_MIDDLE), Pigments(skin)._rim_blood()
    rim = skin.coordinates.loop < 3.3
    middle, corners = (blood[rim & part].mean() for part in (outer < 0.3, outer > 0.7))
    assert corners > 1.5 * middle > 0


def test_the_fold_runs_out_towards_the_corners(skin: FaceSkin) -> None:
    """Its depth is read off as what the open lid's relief takes from the mesh without it."""
    at = skin.coordinates
    depth = -skin.relief.displacement(np.zeros(len(skin.rest)))
    fold = (at.upper > 0.95) & (at.loop < 12)
    middle, outer = (
        np.percentile(depth[fold & part], 99)
        for part in (np.abs(at.azimuth - LID_MIDDLE) < 0.2, (at.azimuth > 0.65) & (at.azimuth < 0.75))
    )
    assert 0 < outer < 0.85 * middle


def test_the_fold_deepens_and_stays_on_the_shut_lid(skin: FaceSkin) -> None:
    """It went in proportion to the stroke: blind readers saw an aperture close, not a flap of skin.

    In recordings the shut lid keeps most of it.
    """
    at = skin.coordinates
    middle = (at.upper > 0.95) & (at.loop < 12) & (np.abs(at.azimuth - LID_MIDDLE) < 0.2)
    opened, half, late, shut = (
        np.percentile(-skin.relief.displacement(np.full(len(skin.rest), stroke))[middle], 99)
        for stroke in (0.0, 0.5, 0.85, 1.0)
    )
    assert half > opened
    assert half > late > shut > 0.75 * opened


def test_the_upper_margin_is_the_darker_and_the_paler_in_blood(
    skin: FaceSkin, values: dict[str, Array]
) -> None:
    at = skin.coordinates
    rim = (at.loop < 3.3) & (np.abs(at.azimuth - LID_MIDDLE) < 0.6)
    upper, lower = rim & (at.upper > 0.95), rim & (at.upper < 0.05)
    assert values["mel"][upper].mean() > values["mel"][lower].mean() + 0.4
    blood = Pigments(skin)._rim_blood()
    assert 0 < blood[upper].mean() < 0.7 * blood[lower].mean()


def test_the_nasal_corner_is_less_wet_than_the_margins(skin: FaceSkin, values: dict[str, Array]) -> None:
    """Its wet skin mirrored the key light as one white dot, which stayed alone as the lid came down."""
    at = skin.coordinates
    rim = (at.loop < 3.2) & (skin.rest[:, 2] > 4)
    assert values["wet"][rim & (at.azimuth < -0.8)].max() < 0.3
    assert values["wet"][rim & (np.abs(at.azimuth) < 0.3)].min() > 0.9


def test_no_lines_run_together_on_the_line_of_the_corners(skin: FaceSkin, values: dict[str, Array]) -> None:
    """There the coordinate along which lines are drawn jumps from the lower lid's to the upper one's."""
    at = skin.coordinates
    jumps = (at.upper > 0.2) & (at.upper < 0.8)
    assert jumps.sum() > 20
    assert values["fine"][jumps].max() == 0
    apart = (at.upper < 0.01) & (at.loop > 6) & (at.loop < 9) & (skin.rest[:, 2] > 4)
    assert values["fine"][apart].min() > 0


def test_the_skin_beside_a_nasal_corner_is_redder_and_duller_than_the_skin_beyond(
    skin: FaceSkin, values: dict[str, Array]
) -> None:
    corner = Pigments(skin)._nasal_corner()
    near = (corner > 0.9) & (skin.relief.flesh == 0)
    beyond = (corner == 0) & (skin.rest[:, 2] > 4)
    assert near.sum() > 50
    assert values["shine"][near].max() < 0.25
    assert np.median(values["hem"][near]) > np.median(values["hem"][beyond]) + 0.12


def test_the_fold_of_the_nasal_corner_is_moist_flesh(skin: FaceSkin, values: dict[str, Array]) -> None:
    """Of the color of skin it was a pit behind a corner that ended blunt."""
    flesh, beside = skin.relief.flesh > 0.9, (skin.relief.flesh == 0) & (Pigments(skin)._nasal_corner() > 0.5)
    assert flesh.sum() > 20
    assert np.abs(skin.coordinates.azimuth[flesh] - skin.coordinates.azimuth[flesh].mean()).max() < 0.5
    assert values["mel"][flesh].mean() < 0.8 * values["mel"][beside].mean()
    assert values["hem"][flesh].mean() > values["hem"][beside].mean() + 0.3
    assert values["rough"][flesh].mean() < values["rough"][beside].mean() - 0.12
    assert values["shine"][flesh].mean() > values["shine"][beside].max()


def test_that_flesh_stands_out_of_its_fold_only_while_the_eye_is_open(skin: FaceSkin) -> None:
    flesh, still = skin.relief.flesh > 0.9, np.ones(len(skin.rest))
    opened, shut = skin.relief.displacement(0 * still)[flesh], skin.relief.displacement(still)[flesh]
    # The grain on top at most about doubles it: 2.01 times in the corner of recipe 38.
    assert MOUND_RISE_CM < (opened - shut).max() < 2.2 * MOUND_RISE_CM
    assert (opened - shut).min() > -0.02 * MOUND_RISE_CM
    assert np.abs(shut).max() < 0.2 * MOUND_RISE_CM


def test_flesh_reaches_to_the_lids_edges(skin: FaceSkin) -> None:
    """They end blunt at the nose, and of the color of skin that end was a pale hook about the white."""
    for side in (1, -1):
        for edge in (0, 2):
            at = nasal_tip(skin.path, skin.path.rest, side, edge)
            near = np.linalg.norm(skin.rest - at, axis=1) < 0.03
            assert skin.relief.flesh[near].min() > 0.9, (side, edge)
        for loop in (0, 2):
            margin = chains(skin.path.kit, skin.path.loops[side][loop], side)[1][3]
            near = np.linalg.norm(skin.rest - skin.path.rest[margin], axis=1) < 0.02
            assert skin.relief.flesh[near].min() > 0.9, (side, loop)


def test_fine_grain_ends_where_skin_turns_away(kit: FaceKit, skin: FaceSkin) -> None:
    """Seen from the side it became upright streaks at the temples."""
    eyes = FRAMINGS["eyes"]
    part = subdivide(face_part(kit, eyes.low, eyes.high), 2)
    face = FaceSkin(skin.path, skin.identity, part, skin.strokes)
    blood, away, quads = Pigments(face).values()["hem"], normals(face.rest, part.quads)[:, 2], part.quads

    def grain(where: NDArray[np.bool_]) -> float:
        """Median step of blood from vertex to vertex beyond the lids, per cm."""
        chosen = quads[(where & (face.coordinates.loop > 13.5) & (face.rest[:, 2] > 2))[quads].all(axis=1)]
        following = np.roll(chosen, -1, axis=1)
        step = np.abs(np.log(blood[chosen] / blood[following]))
        return float(np.median(step / np.linalg.norm(face.flat[chosen] - face.flat[following], axis=-1)))

    assert grain(away < 0.2) < 0.7 * grain(away > 0.8)
