"""Brow, cheek, squint and gaze: declared in mm, measured in the pictures, and nothing else moved."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.load import locate, parse_experiment
from stimuli_builder.clips.build import build
from stimuli_builder.clips.characters import find_character, geometry
from stimuli_builder.clips.cli_clip import settings_from
from stimuli_builder.clips.design_clips import Options, PlannedClip, check_look, look_of, planned_clips
from stimuli_builder.clips.face_movement import moved_levels
from stimuli_builder.clips.folder import moved_mm
from stimuli_builder.clips.geometry import AS_BAKED, Movement
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.verify import verify

EXP3 = locate("exp3").read_text(encoding="utf-8")
SIZE = (960, 360)
EYE = (705, 213)
"""Column and row in px of the middle of alder's left eye, which the participant sees at the right."""


def every_eighth(name: str) -> LevelSet:
    """Seventeen levels of a character: all of them take the test four times as long."""
    whole = find_character(name).levels(SIZE)
    return replace(whole, levels=np.ascontiguousarray(whole.levels[::8]), closures=whole.closures[::8])


@pytest.fixture(scope="module")
def alder() -> LevelSet:
    return every_eighth("alder@8")


def moved(character: LevelSet, movement: Movement) -> LevelSet:
    return moved_levels(character, geometry(character.name), movement)


def displacement_mm(
    still: LevelSet, shown: LevelSet, closure: float, at_mm: tuple[float, float], size_mm: float
) -> NDArray[np.float64]:
    """Mm to the temple and up by which a patch of alder's left eye moved (Lucas & Kanade 1981)."""
    scale, half = still.px_per_mm, round(size_mm * still.px_per_mm / 2)
    column, row = round(EYE[0] + at_mm[0] * scale), round(EYE[1] - at_mm[1] * scale)
    patch = slice(max(row - half, 0), row + half), slice(column - half, column + half)
    grey = [
        cv2.cvtColor(one.picture(closure), cv2.COLOR_RGB2GRAY).astype(np.float32) for one in (still, shown)
    ]
    before, after = (cv2.GaussianBlur(picture, (0, 0), 0.7) for picture in grey)
    rows, columns = np.mgrid[0 : before.shape[0], 0 : before.shape[1]].astype(np.float32)
    step = np.zeros(2, np.float32)
    for _ in range(20):
        carried = cv2.remap(before, columns - step[0], rows - step[1], cv2.INTER_CUBIC)
        slope_down, slope_right = (one[patch].ravel() for one in np.gradient(carried))
        terms = np.stack([-slope_right, -slope_down], 1)
        step += np.linalg.lstsq(terms, (after - carried)[patch].ravel(), rcond=None)[0]
    return np.array([step[0], -step[1]]) / scale


@pytest.mark.parametrize(
    ("part", "closure", "at_mm", "direction"),
    [
        ("brow", 1.0, (5.0, 22.0), (-0.71, -0.71)),
        ("cheek", 1.0, (17.0, -17.3), (-0.21, 0.98)),
        ("squint", 1.0, (5.0, -15.5), (-0.71, 0.71)),
        ("gaze", 0.5, (0.0, -2.4), (-0.5, -1.0)),
    ],
)
def test_a_part_moves_as_far_as_declared(
    alder: LevelSet, part: str, closure: float, at_mm: tuple[float, float], direction: tuple[float, float]
) -> None:
    for amount in (0.3, 0.6):
        shown = moved(alder, Movement(**{part: amount}))
        got = displacement_mm(alder, shown, closure, at_mm, 2.5)
        asked = closure * amount * np.array(direction)
        assert np.linalg.norm(got - asked) < 0.01 + 0.1 * np.linalg.norm(asked), (got, asked)


def test_nothing_else_moves(alder: LevelSet) -> None:
    shown = moved(alder, Movement(brow=1.0, cheek=1.0, squint=1.0))
    np.testing.assert_array_equal(shown.picture(0.0), alder.picture(0.0))
    scale = alder.px_per_mm
    # The eye with both lids: from the upper lid's fold to the lower lid's margin.
    rows = slice(round(EYE[1] - 8.0 * scale), round(EYE[1] + 5.5 * scale))
    columns = slice(round(EYE[0] - 14.0 * scale), round(EYE[0] + 14.0 * scale))
    for closure in (0.25, 0.5, 1.0):
        np.testing.assert_array_equal(
            shown.picture(closure)[rows, columns], alder.picture(closure)[rows, columns]
        )


def test_gaze_leaves_lids_and_skin(alder: LevelSet) -> None:
    shown = moved(alder, Movement(gaze=0.5))
    assert shown.window == alder.window
    np.testing.assert_array_equal(shown.levels[-1], alder.levels[-1])
    changed = np.any(shown.picture(0.5) != alder.picture(0.5), axis=2)
    rows, columns = np.nonzero(changed[:, 480:])
    assert np.abs(columns + 480 - EYE[0]).max() < 9.5 * alder.px_per_mm
    assert rows.min() >= EYE[1] - 1.5 * alder.px_per_mm
    assert rows.max() <= EYE[1] + 6.0 * alder.px_per_mm


def test_the_lower_lid_is_found_in_the_greater_picture(alder: LevelSet) -> None:
    shown = moved(alder, Movement(brow=0.5))
    places = [
        (one.window.y + one.lower.rows.start, one.window.x + one.lower.columns.start)
        for one in (alder, shown)
    ]
    assert places[0] == places[1]


def test_the_cartoons_brows_can_be_held_still() -> None:
    drawn = every_eighth("cartoon")
    held = moved(drawn, Movement(brow=0.0))
    brow = slice(round(180 - 26 * 7.5), round(180 - 8 * 7.5)), slice(600, 850)
    brow = slice(max(brow[0].start, 0), brow[0].stop), brow[1]
    change = [
        np.abs(one.picture(1.0)[brow].astype(float) - one.picture(0.0)[brow]).mean() for one in (drawn, held)
    ]
    assert change[1] < 0.25 * change[0]


def planned(render: str) -> PlannedClip:
    text = EXP3.replace("[render]\n", f"[render]\n{render}\n", 1).replace("per_cell = 20", "per_cell = 1")
    return planned_clips(parse_experiment(text), Options())[0]


def test_what_is_not_declared_changes_no_hash() -> None:
    as_it_was, declared = planned(""), planned("brow_mm = 0.5\ncheek_mm = 0.3\nsquint_mm = 0.2")
    assert "movement" not in as_it_was.job.look.hashed()
    assert as_it_was.job.look.movement == AS_BAKED
    assert declared.job.input_hash != as_it_was.job.input_hash
    assert not [key for key in moved_mm(as_it_was) if "squint" in key or "gaze" in key]


def test_the_manifest_says_in_mm_what_was_declared_and_shown() -> None:
    clip = planned("brow_mm = 0.5\ncheek_mm = 0.0\ngaze_mm = 0.0")
    peak = float(clip.job.curve.closure.max())
    assert moved_mm(clip)["brow_mm"] == f"{0.5 * peak:.3f}"
    assert moved_mm(clip)["cheek_mm"] == "0.000"
    inputs = clip.job.look.movement.inputs()
    assert inputs == {"declared_brow_mm": "0.5", "declared_cheek_mm": "0.0", "declared_gaze_mm": "0.0"}
    assert Movement.of_inputs(inputs) == clip.job.look.movement


def test_clips_with_a_moving_brow_measure_as_promised(tmp_path: Path, small_text: str) -> None:
    asked = """
name = "browed"
title = "A cartoon's brow"

[[factors]]
name = "brow"
label = "Brow"
[[factors.levels]]
name = "still"
label = "Still"
render = { brow_mm = 0.0 }
[[factors.levels]]
name = "low"
label = "Low"
render = { brow_mm = 1.0, cheek_mm = 0.5 }
[exemplars]
per_cell = 1
[render]
character = "cartoon"
width_px = 480
height_px = 180

"""
    text = asked + small_text[small_text.index("[trial]") :]
    build(parse_experiment(text), tmp_path, Options())
    verdict = verify(tmp_path)
    assert (verdict.findings, verdict.opening_checked) == ((), 2)
    assert verdict.worst_opening_mm < 0.15


def test_what_cannot_move_is_said_in_one_line(alder: LevelSet) -> None:
    settings = settings_from(character="cartoon", gaze_mm=0.4)
    with pytest.raises(InputError, match="is drawn with eyes that look straight ahead; remove gaze_mm"):
        check_look(settings, geometry("cartoon"))
    check_look(settings_from(character="cartoon", gaze_mm=0.0), geometry("cartoon"))
    with pytest.raises(InputError, match=r"--brow-mm: expected at most 1, got 1\.5"):
        settings_from(brow_mm=1.5)
    elsewhere = replace(geometry("alder@8"), inter_ocular_mm=16.0)
    with pytest.raises(InputError, match=r"no eye that closes was found 8 mm from .* remove brow_mm"):
        moved_levels(alder, elsewhere, Movement(brow=0.5))
    assert look_of(settings_from(character="alder@8", brow_mm=0.0), Options()).movement.declared == {
        "brow": 0
    }
    # alder's brows hold still of themselves: nothing is to be moved.
    assert moved(alder, Movement(brow=0.0)) is alder
