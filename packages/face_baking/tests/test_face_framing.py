"""The framing from forehead to chin: what it shows, what a blink changes, and the character made."""

from pathlib import Path

import numpy as np
import pytest
from face_baking.bake import FaceBake, FaceOrder
from face_baking.blink_path import BlinkPath
from face_baking.framing import FRAMINGS, View
from face_baking.identity import load_identity
from face_baking.kit import FaceKit
from face_baking.plan import Samples

from stimuli_builder.characters.atlas import load_atlas
from stimuli_builder.clips.characters import find_character

SIZE = (240, 300)
CHIN, BROWS, MOUTH = 8, slice(17, 27), slice(48, 68)
"""Of the 68 landmarks."""


@pytest.mark.parametrize("name", ["alder", "birch", "cedar", "hazel"])
def test_the_picture_holds_brows_mouth_and_chin_and_no_crown(kit: FaceKit, name: str) -> None:
    identity = load_identity(name)
    rest = identity.rest(kit)
    globes = BlinkPath(kit, rest, identity.movement).globes
    view = View.of(FRAMINGS["face"], SIZE, globes[1].centre, globes[-1].centre)
    at = view.project(rest[kit.landmarks])
    inside = (at > 0).all(axis=1) & (at < SIZE).all(axis=1)
    assert inside[BROWS].all()
    assert inside[MOUTH].all()
    assert at[CHIN, 1] < SIZE[1]
    crown = view.project(rest[[int(rest[:, 1].argmax())]])
    assert crown[0, 1] < -0.1 * SIZE[1]


def test_a_face_becomes_a_character_in_which_the_eyes_alone_change(kit: FaceKit, tmp_path: Path) -> None:
    order = FaceOrder(
        name="alder",
        identity=load_identity("alder"),
        framing="face",
        size_px=SIZE,
        levels=9,
        rendered=2,
        samples=Samples(1, 1),
        lower_lid=False,
        light="studio",
        out=tmp_path / "alder-face",
        work=tmp_path / "work",
        blender=tmp_path / "none",
        device="cpu",
        threads=1,
    )
    bake = FaceBake(order, kit)
    bake.work.mkdir(parents=True)
    for shot in bake.shots:
        grey = 0.3 - 0.1 * shot.pose.closure
        np.savez(shot.file, **{k: np.full((b[3], b[2], 3), grey, np.float16) for k, b in shot.boxes.items()})
    bake.run(lambda *_: None)
    atlas = load_atlas(tmp_path / "alder-face")
    assert atlas.name == "alder-face"
    assert atlas.declaration.label.endswith("forehead to chin")
    assert "--identity alder --framing face" in atlas.declaration.provenance["command"]
    _, _, width, height = atlas.declaration.crop
    assert width * height < 0.25 * SIZE[0] * SIZE[1]
    levels = find_character(str(tmp_path / "alder-face")).levels(SIZE)
    assert levels.size_px == SIZE
    changed = np.any(levels.levels[0] != levels.levels[-1], axis=2)
    assert changed.any()
    assert not changed[[0, -1]].any()
