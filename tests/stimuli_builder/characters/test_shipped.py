"""The shipped photorealistic atlas: whole, still outside what a blink moves, and within its size limit."""

import numpy as np
import pytest

from stimuli_builder.characters.atlas import SHIPPED, Atlas, load_atlas
from stimuli_builder.characters.photorealistic.parameters import load_presets


@pytest.fixture(scope="module")
def character() -> Atlas:
    return load_atlas(SHIPPED / "photorealistic")


def test_every_picture_is_whole_and_what_was_declared(character: Atlas) -> None:
    character.check_files()
    assert character.has_lower_lid
    assert character.declaration.opening_mm == 11.0
    assert {"command", "versions", "date", "rendered_closures"} <= set(character.declaration.provenance)


def test_blink_begins_at_the_still_frame_and_leaves_its_rim_alone(character: Atlas) -> None:
    levels = character.levels_linear()
    np.testing.assert_array_equal(character.base_linear()[character.crop], levels[0])
    for rim in (levels[:, 0], levels[:, -1], levels[:, :, 0], levels[:, :, -1]):
        np.testing.assert_array_equal(rim, np.broadcast_to(rim[0], rim.shape))


def test_atlas_stays_below_25_megabytes() -> None:
    assert sum(file.stat().st_size for file in (SHIPPED / "photorealistic").iterdir()) < 25e6


def test_both_presets_have_a_preview() -> None:
    assert {file.stem for file in (SHIPPED / "previews").glob("*.webp")} == set(load_presets())
