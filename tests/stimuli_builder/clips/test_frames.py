"""The pictures of a clip."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.atlas import load_atlas
from stimuli_builder.characters.colour import encode_srgb
from stimuli_builder.characters.declaration import write_example_character
from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.frames import FramePainter, read_barcode
from stimuli_builder.clips.kernels import GAMMA
from stimuli_builder.clips.levels import LevelSet
from tests.helpers.lower_lid_change import lower_lid_change


@pytest.fixture(scope="module")
def cartoon() -> LevelSet:
    return find_character("cartoon").levels((320, 120))


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> LevelSet:
    folder = write_example_character(tmp_path_factory.mktemp("tiny") / "tiny")
    return find_character(str(folder)).levels((48, 24))


def curve_of(*closure: float, hold: int = 10) -> ClipCurve:
    return ClipCurve(np.repeat(np.array(closure, float), hold), 0, "test")


def test_a_resting_eye_is_the_open_frame_and_nothing_outside_the_window_moves(cartoon: LevelSet) -> None:
    frames = list(FramePainter(cartoon).frames(curve_of(0, 0.5, 1, 0.3, 0), 30, True))
    np.testing.assert_array_equal(frames[0], frames[-1])
    changed = np.zeros((120, 320), bool)
    for frame in frames:
        changed |= frame[:120] != frames[0][:120]
    assert changed.any()
    changed[cartoon.window.slices] = False
    assert not changed.any()


def test_blur_averages_light_not_code_values(cartoon: LevelSet) -> None:
    ramp = ClipCurve(np.linspace(0, 1, 10), 0, "ramp")
    light = FramePainter(cartoon).light(ramp, np.arange(10), np.full(10, 0.1))
    stills = [
        np.tensordot(weights, cartoon.levels, axes=1) for weights in cartoon.level_weights(ramp.closure)
    ]
    np.testing.assert_allclose(light, np.mean(stills, axis=0), atol=2)
    of_codes = np.mean([encode_srgb(still.astype(np.float32) / 65535) for still in stills], axis=0)
    of_light = encode_srgb(light / np.float32(65535))
    assert np.abs(of_codes - of_light).max() * 255 > 10


def test_a_frame_without_blur_is_the_still_picture(cartoon: LevelSet) -> None:
    (frame,) = FramePainter(cartoon).frames(curve_of(0.37), 30, False)
    rows, columns = cartoon.window.slices
    still = np.tensordot(cartoon.level_weights(np.array([0.37]))[0], cartoon.levels, axes=1)
    code = GAMMA[np.round(still).astype(int)] @ np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose(frame[rows, columns], 16 + 219 * code, atol=0.6)


def test_eyes_that_move_apart_show_the_left_eye_at_the_right(cartoon: LevelSet) -> None:
    painter = FramePainter(cartoon)
    closed, opened = np.full(10, 1.0), np.zeros(10)
    (apart,) = painter.frames(ClipCurve(closed, 0, "left shut", closure_other=opened), 30, True)
    (both,) = painter.frames(ClipCurve(closed, 0, "shut"), 30, True)
    (neither,) = painter.frames(ClipCurve(opened, 0, "open"), 30, True)
    np.testing.assert_array_equal(apart[:120, 175:], both[:120, 175:])
    np.testing.assert_array_equal(apart[:120, :145], neither[:120, :145])


def test_a_barcode_numbers_the_frames(cartoon: LevelSet) -> None:
    frames = FramePainter(cartoon).frames(curve_of(0, 1, 0), 30, True, barcode=True)
    assert [read_barcode(frame[:120]) for frame in frames] == [0, 1, 2]


def lower_curve(closure: float, vertical: float, horizontal: float) -> ClipCurve:
    def held(value: float) -> NDArray[np.float64]:
        return np.full(10, value)

    return ClipCurve(
        held(closure),
        0,
        "lower",
        lower_vertical_mm=held(vertical),
        lower_horizontal_mm=held(horizontal),
    )


@pytest.mark.parametrize("pose", [(0.0, 0.5, 0.0), (0.4, 0.8, 0.3), (0.9, 1.0, 1.0)])
def test_the_lower_lid_is_the_characters_own_layer(
    tiny: LevelSet, tmp_path_factory: pytest.TempPathFactory, pose: tuple[float, float, float]
) -> None:
    atlas = load_atlas(write_example_character(tmp_path_factory.mktemp("again") / "tiny"))
    samples, weights = np.arange(10), np.full(10, 0.1)
    painter = FramePainter(tiny)
    moved = painter.light(lower_curve(*pose), samples, weights)
    still = painter.light(ClipCurve(np.full(10, pose[0]), 0, "still"), samples, weights)
    rows, columns = (
        slice(crop.start - start, crop.stop - start)
        for crop, start in zip(atlas.crop, (tiny.window.y, tiny.window.x), strict=True)
    )
    expected = lower_lid_change(atlas, *pose)
    np.testing.assert_allclose((moved - still)[rows, columns] / 65535, expected, atol=1e-4)


def test_the_lower_lid_is_read_once_it_moves(tmp_path: Path) -> None:
    """A damaged pose is of no matter to clips that show none, and said by the first that does."""
    folder = write_example_character(tmp_path / "tiny")
    levels = find_character(str(folder)).levels((48, 24))
    next(folder.glob("pose_*.webp")).write_bytes(b"no picture")
    painter = FramePainter(levels)
    assert list(painter.frames(curve_of(0, 1, 0), 30, True))
    with pytest.raises(InputError, match=r"lower-lid pose .* is damaged"):
        list(painter.frames(lower_curve(0, 0.5, 1), 30, True))


def test_a_character_without_lower_lid_refuses_one(cartoon: LevelSet) -> None:
    with pytest.raises(InputError, match="no lower-lid layer"):
        list(FramePainter(cartoon).frames(lower_curve(0, 0, 0), 30, True))


@pytest.mark.parametrize("size", [(96, 48), (30, 14), (96, 40)])
def test_other_sizes_are_resampled_with_still_edges(
    tmp_path_factory: pytest.TempPathFactory, size: tuple[int, int]
) -> None:
    folder = write_example_character(tmp_path_factory.mktemp("sized") / "tiny")
    levels = find_character(str(folder)).levels(size)
    assert levels.size_px == size
    assert levels.px_per_mm == pytest.approx(1.5 * size[0] / 48)
    np.testing.assert_array_equal(levels.base[levels.window.slices], levels.levels[0])
    assert np.abs(levels.levels[0][0].astype(int) - levels.levels[-1][0]).max() <= 66


@pytest.mark.parametrize(
    ("size", "line"),
    [
        ((48, 40), "24 px high"),
        ((48, 10), "cuts off moving parts of a blink of 'tiny', which is 24 px high"),
        ((48, 10), "its own size: --size 48x24, or width_px = 48, height_px = 24"),
    ],
)
def test_a_size_that_cannot_show_the_blink_is_refused(
    tmp_path_factory: pytest.TempPathFactory, size: tuple[int, int], line: str
) -> None:
    character = find_character(str(write_example_character(tmp_path_factory.mktemp("bad") / "tiny")))
    with pytest.raises(InputError, match=line):
        character.levels(size)


def test_the_resting_picture_is_converted_once_and_no_clip_changes_it(tiny: LevelSet) -> None:
    painter = FramePainter(tiny)
    before = tiny.base_planes.copy()
    for frame in painter.frames(curve_of(0, 1, 0), 30, False, barcode=True):
        frame[:] = 0
    np.testing.assert_array_equal(tiny.base_planes, before)
    (resting,) = FramePainter(tiny).frames(curve_of(0), 30, False)
    np.testing.assert_array_equal(resting, before)
