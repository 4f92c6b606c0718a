"""The atlas: any folder of pictures with a declaration works as a character."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.characters.atlas import load_atlas
from stimuli_builder.characters.colour import level_weights, linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.declaration import (
    CROP,
    declaration_toml,
    draw_crop,
    read_declaration,
    write_example_character,
)
from tests.helpers.lower_lid_change import lower_lid_change


def test_levels_are_the_pictures_in_linear_light(tiny_character: Path) -> None:
    character = load_atlas(tiny_character)
    levels = character.levels_linear()
    assert levels.shape == (4, CROP[3], CROP[2], 3)
    assert levels.dtype == np.float32
    np.testing.assert_array_equal(linear_to_srgb(levels[2]), draw_crop(0.5))
    np.testing.assert_array_equal(character.base_linear()[character.crop], levels[0])


def test_declaration_survives_a_round_trip(tiny_character: Path) -> None:
    declaration = read_declaration(tiny_character)
    (tiny_character / "character.toml").write_text(declaration_toml(declaration))
    assert read_declaration(tiny_character) == declaration


def test_a_second_version_is_named_and_counted(tiny_character: Path) -> None:
    file = tiny_character / "character.toml"
    first = file.read_text()
    assert 'name = "tiny"' in first
    assert "version = 1" in first
    file.write_text(first.replace('"tiny"', '"tiny@2"').replace("version = 1", "version = 3"))
    assert read_declaration(tiny_character).name == "tiny@2"
    file.write_text(first.replace('"tiny"', '"tiny@2"'))
    with pytest.raises(InputError, match="version of 'tiny@2' must be 2 or more; it is 1"):
        read_declaration(tiny_character)
    file.write_text(first.replace('"tiny"', '"tiny@"'))
    with pytest.raises(InputError, match="name"):
        read_declaration(tiny_character)


def test_every_code_value_survives_linear_light() -> None:
    codes = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(linear_to_srgb(srgb_to_linear(codes)), codes)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
@settings(deadline=None, max_examples=40)
def test_weights_rebuild_the_closure(closures: list[float]) -> None:
    levels = np.array([0.0, 0.25, 0.5, 1.0])
    weights = level_weights(levels, closures)
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-12)
    np.testing.assert_allclose(weights @ levels, closures, atol=1e-12)
    assert ((weights > 0).sum(1) <= 2).all()
    assert (weights >= 0).all()


def test_resting_lower_lid_changes_nothing(tiny_character: Path) -> None:
    assert not lower_lid_change(load_atlas(tiny_character), 0.3, 0.0, 0.0).any()


def test_open_eye_with_raised_lower_lid_is_the_baked_pose(tiny_character: Path) -> None:
    character = load_atlas(tiny_character)
    image = srgb_to_linear(draw_crop(0.0)) + lower_lid_change(character, 0.0, 1.0, 0.0)
    np.testing.assert_array_equal(linear_to_srgb(image), draw_crop(0.0, 4))


def test_closed_upper_lid_hides_the_lower_lid(tiny_character: Path) -> None:
    assert not lower_lid_change(load_atlas(tiny_character), 1.0, 1.0, 1.0).any()


def test_character_without_lower_lid_says_so(tmp_path: Path) -> None:
    character = load_atlas(write_example_character(tmp_path / "plain", lower_lid=False))
    with pytest.raises(InputError, match="has no lower-lid layer"):
        _ = character.lower_lid_layer


def test_missing_level_is_named_on_loading(tiny_character: Path) -> None:
    (tiny_character / "level_0.50.webp").unlink()
    with pytest.raises(InputError, match=r"level_0\.50\.webp is missing"):
        load_atlas(tiny_character)


@pytest.mark.parametrize("damage", [b"", b"not a picture", None])
def test_damaged_level_is_named(tiny_character: Path, damage: bytes | None) -> None:
    file = tiny_character / "level_0.50.webp"
    file.write_bytes(file.read_bytes()[:-7] if damage is None else damage)
    with pytest.raises(InputError, match=r"atlas level 2 \(closure 0.5\) is damaged"):
        load_atlas(tiny_character).check_files()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("closure = 0.25", "closure = 0.75", "ascending"),
        ("closure = 1.0", "closure = 0.9", "from closure 0"),
        ("crop = [4, 4, 40, 16]", "crop = [10, 4, 40, 16]", "inside the"),
        ('name = "tiny"', 'nmae = "tiny"', "name: this key is required but missing"),
        ('file = "level_0.50.webp"', 'file = "../level.webp"', "inside the character's folder"),
        ("px_per_mm = 1.5", "px_per_mm = ", "is not TOML"),
        ("horizontal_mm = 1.0", "horizontal_mm = 2.0", "every pair"),
    ],
)
def test_wrong_declaration_is_one_clear_line(tiny_character: Path, old: str, new: str, message: str) -> None:
    file = tiny_character / "character.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        load_atlas(tiny_character)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        # As an older format, a later one, and no format at all.
        (
            b'name = "old"\nlevels = ["open.png", "shut.png"]\n',
            "label: this key is required but missing; .* another version",
        ),
        (
            b'format = 9\nname = "new"\nlabel = "New"\n',
            "this key is required but missing; .* bake it again",
        ),
        (b"\xff\xfe", "not UTF-8 text; restore the complete file"),
        (b"", "this key is required but missing"),
    ],
)
def test_an_atlas_of_another_format_is_one_clear_line(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "character.toml").write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_atlas(tmp_path)
    assert "\n" not in str(caught.value)


def test_folder_without_declaration_is_not_a_character(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a character"):
        load_atlas(tmp_path)
