"""The shipped faces: whole, as they were pinned, still outside what a blink moves, and within their size."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from experiments.load import load_experiment
from stimuli_builder.characters.atlas import SHIPPED, Atlas, load_atlas

FACES = sorted(file.parent.name for file in SHIPPED.glob("*/ICT-FaceKit-LICENSE.txt"))
PINNED = json.loads((Path(__file__).parent / "shipped.json").read_text())


@pytest.fixture(scope="module", params=FACES)
def face(request: pytest.FixtureRequest) -> Atlas:
    return load_atlas(SHIPPED / request.param)


def test_experiments_1_to_3_have_their_face() -> None:
    named = {load_experiment(name).render.character for name in ("exp3", "dcr-demo")}
    named |= {level.render.character for level in load_experiment("exp1").factors[0].levels}
    (face,) = named - {"cartoon"}
    assert load_atlas(SHIPPED / face).has_lower_lid


def test_a_face_that_was_given_to_others_never_changes(face: Atlas) -> None:
    """Pictures that changed need another version, and a new folder: studies name the old one."""
    pinned = PINNED[face.name]
    assert (pinned["version"], pinned["sha256"]) == (face.declaration.version, face.fingerprint())


def test_what_clips_without_the_lower_lid_show_is_of_the_first_version(face: Atlas) -> None:
    """A version may add poses of the lower lid; base and levels are those that the name was given with."""
    declared, digest = face.declaration, hashlib.sha256()
    for picture in (declared.base, declared.levels[0]):
        digest.update((face.folder / picture.file).read_bytes())
    assert {level.file for level in declared.levels} == {declared.levels[0].file}
    assert PINNED[face.name]["levels"] == digest.hexdigest()


def test_every_picture_is_whole_and_says_how_it_was_made(face: Atlas) -> None:
    face.check_files()
    declared = face.declaration
    assert face.folder.name == declared.name
    assert declared.inter_ocular_mm == 60.0
    assert 8.5 < declared.opening_mm < 11.5
    assert {"command", "versions", "date", "rendered_closures", "geometry"} <= set(declared.provenance)
    assert "Permission is hereby granted" in (face.folder / "ICT-FaceKit-LICENSE.txt").read_text()


def test_a_blink_changes_nothing_but_the_lids(face: Atlas) -> None:
    """Code values, so that 0 is 0: rim of the crop, and the bridge of the nose between the eyes."""
    levels = np.stack([face.level_srgb(number) for number in range(0, len(face.closures), 8)])
    middle = levels.shape[2] // 2
    for still in (levels[:, 0], levels[:, -1], levels[:, :, 0], levels[:, :, -1], levels[:, :, middle]):
        np.testing.assert_array_equal(still, np.broadcast_to(still[0], still.shape))
    base = (face.base_linear()[face.crop], face.levels_linear()[0])
    assert np.abs(base[0] - base[1]).max() < 0.05


def test_atlases_stay_small() -> None:
    sizes = {name: sum(file.stat().st_size for file in (SHIPPED / name).iterdir()) for name in FACES}
    assert max(sizes.values()) <= 8e6
    assert sum(sizes.values()) < 60e6
