"""Levels kept as frames of one video: what comes back, and what is said of a damaged one."""

from pathlib import Path

import numpy as np
import pytest
from face_baking.development import psnr_db

from experiments.errors import InputError
from stimuli_builder.characters.atlas import decode_level_video, load_atlas, write_level_video
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.declaration import (
    CLOSURES,
    CROP,
    Declaration,
    Level,
    draw_crop,
    read_declaration,
    write_declaration,
)
from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.levels import quantise_light


def textured(closure: float) -> np.ndarray:
    """A level with skin-like noise that stands still, as a renderer's fixed seed gives."""
    noise = np.random.default_rng(3).integers(-12, 13, (CROP[3], CROP[2], 3))
    return np.clip(draw_crop(closure).astype(int) + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def in_video(tiny_character: Path) -> Path:
    """The example character with its levels in a video of odd size."""
    video = write_level_video(tiny_character, "levels.mkv", [textured(closure) for closure in CLOSURES])
    declared = read_declaration(tiny_character)
    levels = tuple(
        Level(closure=closure, frame=k, **video.model_dump()) for k, closure in enumerate(CLOSURES)
    )
    changed = Declaration.model_validate(declared.model_dump() | {"levels": levels, "lower_lid": None})
    write_declaration(tiny_character, changed)
    return tiny_character


def test_levels_come_back_in_order_and_nearly_as_written(in_video: Path) -> None:
    atlas = load_atlas(in_video)
    atlas.check_files()
    for number, closure in enumerate(CLOSURES):
        assert psnr_db(atlas.level_srgb(number), textured(closure)) > 45


def test_pictures_of_odd_size_keep_it(tmp_path: Path) -> None:
    pictures = [np.full((31, 45, 3), (200, 120, 40 + k), np.uint8) for k in range(3)]
    write_level_video(tmp_path, "odd.mkv", pictures)
    frames = decode_level_video((tmp_path / "odd.mkv").read_bytes(), "levels", "odd.mkv")
    assert frames.shape == (3, 31, 45, 3)
    assert np.abs(frames.astype(int) - np.stack(pictures)).max() <= 2


def test_the_same_pictures_give_the_same_bytes(tmp_path: Path) -> None:
    pictures = [textured(closure) for closure in CLOSURES]
    written = [write_level_video(tmp_path, name, pictures) for name in ("a.mkv", "b.mkv")]
    assert written[0].sha256 == written[1].sha256


def test_alike_levels_take_a_fraction_of_single_pictures(tmp_path: Path) -> None:
    one = write_level_video(tmp_path, "one.mkv", [textured(0.5)])
    many = write_level_video(tmp_path, "many.mkv", [textured(0.5)] * 9)
    sizes = [(tmp_path / picture.file).stat().st_size for picture in (one, many)]
    assert sizes[1] < 2 * sizes[0]


def test_clips_read_a_character_kept_in_a_video(in_video: Path) -> None:
    character = find_character(str(in_video))
    levels = character.levels((48, 24))
    assert len(levels.levels) == len(CLOSURES)
    assert psnr_db(levels.picture(1.0)[4:20, 4:44], textured(1.0)) > 40
    assert len(character.fingerprint) == 64


@pytest.mark.parametrize("video", [True, False])
def test_levels_at_their_own_size_are_the_atlas_to_the_code_value(
    tiny_character: Path, request: pytest.FixtureRequest, video: bool
) -> None:
    """Against the atlas's pictures taken one by one, whether they are converted while decoded or not."""
    folder = request.getfixturevalue("in_video") if video else tiny_character
    levels, atlas = find_character(str(folder)).levels((48, 24)), load_atlas(folder)
    frame = atlas.base_linear()
    for index in range(len(CLOSURES)):
        frame[atlas.crop] = srgb_to_linear(atlas.level_srgb(index))
        np.testing.assert_array_equal(levels.levels[index], quantise_light(frame)[levels.window.slices])
    frame[atlas.crop] = srgb_to_linear(atlas.level_srgb(0))
    np.testing.assert_array_equal(levels.base, quantise_light(frame))


@pytest.mark.parametrize("spare", [-1, 1])
def test_a_video_of_another_length_than_the_levels(in_video: Path, spare: int) -> None:
    """Too short it is refused; frames that no level names do not matter."""
    closures = CLOSURES[:spare] if spare < 0 else [*CLOSURES, CLOSURES[-1]]
    video = write_level_video(in_video, "levels.mkv", [textured(closure) for closure in closures])
    declared = read_declaration(in_video).model_dump()
    for level in declared["levels"]:
        level["sha256"] = video.sha256
    write_declaration(in_video, Declaration.model_validate(declared))
    if spare < 0:
        with pytest.raises(InputError, match="holds 3 of 40 x 16 px, but frame 3"):
            find_character(str(in_video)).levels((48, 24))
    else:
        assert len(find_character(str(in_video)).levels((48, 24)).levels) == len(CLOSURES)


def test_a_video_of_another_size_than_the_crop_is_refused(in_video: Path) -> None:
    declared = read_declaration(in_video).model_dump() | {"crop": (4, 4, 38, 16)}
    write_declaration(in_video, Declaration.model_validate(declared))
    with pytest.raises(InputError, match="of 40 x 16 px, but frame 0 of 38 x 16 px is declared"):
        find_character(str(in_video)).levels((48, 24))


def test_a_damaged_video_is_said_in_one_line(in_video: Path) -> None:
    file = in_video / "levels.mkv"
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(InputError, match=r"atlas level 0 .* is damaged: levels.mkv does not match"):
        load_atlas(in_video).check_files()


def test_bytes_that_are_not_video_are_said_in_one_line() -> None:
    with pytest.raises(
        InputError, match=r"levels is damaged: cannot decode x.mkv; restore the complete file"
    ):
        decode_level_video(b"no video at all", "levels", "x.mkv")


def test_a_frame_beyond_the_video_is_refused(in_video: Path) -> None:
    declared = read_declaration(in_video).model_dump()
    declared["levels"][-1]["frame"] = 9
    write_declaration(in_video, Declaration.model_validate(declared))
    with pytest.raises(InputError, match=r"holds 4 of 40 x 16 px, but frame 9"):
        load_atlas(in_video).check_files()


def test_a_base_kept_as_a_video_of_one_frame(in_video: Path) -> None:
    atlas = load_atlas(in_video)
    frame = linear_to_srgb(atlas.base_linear())
    still = write_level_video(in_video, "open.mkv", [frame])
    declared = read_declaration(in_video).model_dump() | {"base": {**still.model_dump(), "frame": 0}}
    write_declaration(in_video, Declaration.model_validate(declared))
    kept = load_atlas(in_video)
    kept.check_files()
    assert psnr_db(linear_to_srgb(kept.base_linear()), frame) > 44
    assert kept.fingerprint() != atlas.fingerprint()


def test_mattes_are_pictures(tiny_character: Path) -> None:
    declared = read_declaration(tiny_character).model_dump()
    declared["lower_lid"]["mattes"][0]["frame"] = 0
    with pytest.raises(ValueError, match=r"lower_lid.mattes must be pictures"):
        Declaration.model_validate(declared)
