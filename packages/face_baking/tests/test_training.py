"""Training samples: what is drawn, labels against the geometry, and a run that was stopped."""

import json
from pathlib import Path

import numpy as np
import pytest
from face_baking.identity import load_identity
from face_baking.kit import FaceKit
from face_baking.lid_pose import LidPose
from face_baking.training import run
from face_baking.training.draw import MAX_GAZE, MAX_TURN, SamplePose, draw_sample
from face_baking.training.labels import labels_of
from face_baking.training.run import SamplesOrder, make_samples, photographed
from face_baking.training.scene import SampleScene

from experiments.errors import InputError

SIZE = (320, 160)
BLENDER = Path(__file__).parents[3] / ".venv-bake"


@pytest.fixture(scope="module")
def scene(kit: FaceKit) -> SampleScene:
    return SampleScene(kit, load_identity("alder"), SIZE)


def order(out: Path, count: int = 2, seed: int = 1) -> SamplesOrder:
    return SamplesOrder(count, seed, SIZE, 1, out, BLENDER, "cpu", 2)


def test_a_number_draws_the_same_sample_within_its_ranges() -> None:
    drawn = [draw_sample(3, number) for number in range(300)]
    assert drawn == [draw_sample(3, number) for number in range(300)]
    assert drawn != [draw_sample(4, number) for number in range(300)]
    assert max(abs(g) for sample in drawn for g in sample.pose.gaze) <= MAX_GAZE
    assert max(abs(t) for sample in drawn for t in sample.pose.turn) <= MAX_TURN
    closures = [sample.pose.closure for sample in drawn]
    assert min(closures) == 0.0
    assert max(closures) == 1.0
    assert any(sample.pose.closure != sample.pose.closure_right for sample in drawn)
    assert {sample.pose.glasses for sample in drawn} == {True, False}


def test_labels_follow_the_lids_from_open_to_shut(scene: SampleScene) -> None:
    opened, half, shut = (
        labels_of(scene, SamplePose(w, closure_right=w))["eyes"]["left"] for w in (0.0, 0.5, 1.0)
    )
    wanted = scene.opening_mm * scene.view.px_per_mm
    assert opened["opening_px"] == pytest.approx(wanted, rel=0.15)
    assert half["opening_px"] == pytest.approx(opened["opening_px"] / 2, rel=0.15)
    assert shut["opening_px"] < 0.1 * opened["opening_px"]
    assert opened["iris"]["visible"] > 0.75 > half["iris"]["visible"] > 0.2
    assert shut["iris"]["visible"] == 0.0
    # The lower lid's edge hardly moves, the upper one's comes down to it.
    upper, lower = np.array(half["upper"]), np.array(half["lower"])
    assert (upper[5:-5, 1] < lower[5:-5, 1]).all()
    assert np.abs(np.array(opened["lower"]) - lower).max() < 0.2 * opened["opening_px"]


def test_one_eye_may_be_shut_alone(scene: SampleScene) -> None:
    eyes = labels_of(scene, SamplePose(0.0, closure_right=1.0))["eyes"]
    assert eyes["left"]["iris"]["visible"] > 0.75
    assert eyes["right"]["iris"]["visible"] == 0.0


def test_gaze_moves_the_iris_and_a_turn_the_whole_eye(scene: SampleScene) -> None:
    ahead, left, turned = (
        labels_of(scene, pose)["eyes"]["left"]
        for pose in (SamplePose(0.0), SamplePose(0.0, gaze=(20, 0)), SamplePose(0.0, turn=(20, 0, 0)))
    )
    # The person's left is the picture's right. sin(20 degrees) of some 13 mm.
    moved = (left["iris"]["centre"][0] - ahead["iris"]["centre"][0]) / scene.view.px_per_mm
    assert 3.5 < moved < 6.0
    np.testing.assert_allclose(left["nasal"], ahead["nasal"], atol=0.4)
    width = [np.ptp(np.array(eye["lower"])[:, 0]) for eye in (ahead, turned)]
    assert width[1] != pytest.approx(width[0], rel=0.03)
    assert turned["nasal"][0] != pytest.approx(ahead["nasal"][0], abs=1.0)


def test_rims_are_in_every_scene_and_seen_where_they_are_worn(scene: SampleScene) -> None:
    bare, worn = (scene.shapes(SamplePose(0.0, glasses=g))[-1].arrays()["vertices"] for g in (False, True))
    assert bare.shape == worn.shape
    assert bare[:, 1].max() < -100
    at = scene.view.project(worn.astype(float))
    assert (at > 0).all()
    assert (at < SIZE).all()


def test_a_resting_pose_is_the_face_itself(scene: SampleScene) -> None:
    """What a sample does to the face is undone by the next one."""
    before = scene.shapes(LidPose(0.3))[0].arrays()["vertices"]
    scene.shapes(SamplePose(0.6, brow=0.4, squint=0.5, gaze=(20, 10), turn=(15, 5, 0)))
    np.testing.assert_array_equal(scene.shapes(LidPose(0.3))[0].arrays()["vertices"], before)


def test_a_picture_is_exposed_and_compressed_as_drawn() -> None:
    light = np.random.default_rng(1).uniform(0, 0.5, (40, 80, 3)).astype(np.float16)
    sample = draw_sample(1, 0)
    fine = photographed(light, sample.__class__(sample.pose, 0.0, 0.0, 95), 0.0)
    coarse = photographed(light, sample.__class__(sample.pose, 0.0, 0.0, 35), 0.0)
    assert fine.startswith(b"\xff\xd8")
    assert len(coarse) < 0.6 * len(fine)


def test_a_whole_run_renders_nothing_and_another_one_is_refused(kit: FaceKit, tmp_path: Path) -> None:
    """Both lines are there already, the third was cut off as it was written."""
    lines = [json.dumps({"number": number}) for number in (0, 1)]
    file = tmp_path / "labels.jsonl"
    file.write_text("\n".join(lines) + '\n{"number": 2, "fi')
    said: list[tuple[int, int, str]] = []
    make_samples(order(tmp_path), kit, lambda *now: said.append(now))
    assert said == [(2, 2, "begin")]
    assert file.read_text() == "\n".join(lines) + "\n"
    with pytest.raises(InputError, match="has samples with seed 1, but 2 was requested; use another --out"):
        make_samples(order(tmp_path, seed=2), kit, print)
    (tmp_path / "samples.json").write_text("{")
    with pytest.raises(InputError, match=r"samples\.json is damaged; use another --out"):
        make_samples(order(tmp_path), kit, print)


def test_progress_counts_without_reading_the_labels_again(
    kit: FaceKit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parsed after each sample, the labels of thousands would take longer than the pictures."""
    (tmp_path / "labels.jsonl").write_text(json.dumps({"number": 1}) + "\n")
    monkeypatch.setattr(run, "_make_face", lambda order, kit, numbers: iter(numbers))
    said: list[tuple[int, int, str]] = []
    make_samples(order(tmp_path, count=4), kit, lambda *now: said.append(now))
    assert said == [(1, 4, "begin"), (2, 4, "000000"), (3, 4, "000002"), (4, 4, "000003")]


@pytest.mark.skipif(not BLENDER.exists(), reason="Blender's environment .venv-bake is not made here")
def test_blender_renders_samples_with_their_labels(kit: FaceKit, tmp_path: Path) -> None:
    make_samples(order(tmp_path, count=1), kit, lambda *_: None)
    (line,) = (tmp_path / "labels.jsonl").read_text().splitlines()
    assert (tmp_path / json.loads(line)["file"]).stat().st_size > 1000
