"""Planning, resuming and assembling a bake of a face, its faults, and Blender where there is one."""

import errno
import json
import multiprocessing
import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from face_baking.bake import FaceBake, FaceOrder
from face_baking.environment import PACKAGES, missing_packages
from face_baking.eye_texture import GLOBE_CM, eye_maps
from face_baking.eyes import TEXTURE_LIMIT
from face_baking.framing import FRAMINGS, parse_size
from face_baking.identity import (
    IDENTITIES_FILE,
    identity_of_seed,
    load_identity,
)
from face_baking.kit import FaceKit
from face_baking.lid_pose import LidPose
from face_baking.plan import LASHES_HANG, Samples, closures_of
from face_baking.renderer import Renderer, Setup, Shot, load_light
from face_baking.scene import MOVING, FaceScene
from face_baking.sphere import IRIS_CM
from typer.testing import CliRunner

from experiments.errors import InputError
from stimuli_builder.characters.atlas import load_atlas
from stimuli_builder.cli import app

SIZE = (240, 90)
ENVIRONMENT = Path(__file__).parents[3] / ".venv-bake"
BLENDER = ENVIRONMENT / "bin" / "python"
NO_BLENDER = not BLENDER.exists() or bool(missing_packages(ENVIRONMENT))


def order(tmp_path: Path, levels: int = 9, rendered: int = 3) -> FaceOrder:
    return FaceOrder(
        name="alder",
        identity=load_identity("alder"),
        framing="eyes",
        size_px=SIZE,
        levels=levels,
        rendered=rendered,
        samples=Samples(1, 1),
        lower_lid=False,
        light="studio",
        out=tmp_path / "out",
        work=tmp_path / "work",
        blender=tmp_path / "blender",
        device="cpu",
        threads=1,
    )


@pytest.fixture(scope="module")
def scene(kit: FaceKit) -> FaceScene:
    return FaceScene(kit, load_identity("alder"), "eyes", SIZE)


def bake_of(kit: FaceKit, scene: FaceScene, wanted: FaceOrder) -> FaceBake:
    bake = FaceBake(wanted, kit)
    bake.__dict__["scene"] = scene  # built once for the module: it takes seconds
    return bake


def pretend_rendered(bake: FaceBake, count: int) -> None:
    """Put gray shots, darker with closure, where a bake of that many shots would have left its renders."""
    bake.work.mkdir(parents=True, exist_ok=True)
    for shot in bake.shots[:count]:
        grey = 0.3 - 0.1 * shot.pose.closure
        np.savez(shot.file, **{k: np.full((b[3], b[2], 3), grey, np.float16) for k, b in shot.boxes.items()})


def test_the_plan_bisects_and_renders_each_level_once(kit: FaceKit, scene: FaceScene, tmp_path: Path) -> None:
    planned = [shot.pose.closure for shot in bake_of(kit, scene, order(tmp_path, 17, 17)).shots]
    assert planned[:6] == [0.0, 0.0, 1.0, 0.5, 0.25, 0.75]
    assert sorted(planned[1:]) == closures_of(17)


def test_denser_ends_are_rendered_last_and_used(kit: FaceKit, scene: FaceScene, tmp_path: Path) -> None:
    bake = bake_of(kit, scene, replace(order(tmp_path, 33, 9), denser_ends=True))
    planned = [shot.pose.closure for shot in bake.shots]
    assert planned[10:] == [0.0625, 0.9375]
    pretend_rendered(bake, 12)
    bake.write()
    atlas = load_atlas(tmp_path / "out")
    assert len(atlas.closures) == 33
    assert atlas.declaration.provenance["rendered_closures"] == [
        0.0,
        0.0625,
        *closures_of(9)[1:-1],
        0.9375,
        1.0,
    ]
    assert "--rendered 9 --denser-ends" in atlas.declaration.provenance["command"]


def test_other_pictures_of_a_face_are_a_character_of_their_own(
    kit: FaceKit, scene: FaceScene, tmp_path: Path
) -> None:
    bake = bake_of(kit, scene, replace(order(tmp_path), version=2))
    assert bake.work == bake_of(kit, scene, order(tmp_path)).work
    pretend_rendered(bake, 4)
    bake.write()
    declared = load_atlas(tmp_path / "out").declaration
    assert (declared.name, declared.version) == ("alder@2", 2)
    assert declared.provenance["command"].endswith(" --light studio --version 2")


def test_boxes_hold_all_that_moves(scene: FaceScene) -> None:
    opened, shut = (scene.shapes(LidPose(closure))[0].arrays()["vertices"] for closure in (0.0, 1.0))
    moved = np.abs(opened - shut).max(1) > 0.01
    for points in (opened[moved], shut[moved]):
        at = scene.view.project(points.astype(float))
        inside = np.zeros(len(at), bool)
        for x, y, width, height in scene.boxes.values():
            inside |= (at[:, 0] > x) & (at[:, 0] < x + width) & (at[:, 1] > y) & (at[:, 1] < y + height)
        assert inside.all()
    assert all(width < 0.4 * SIZE[0] for _, _, width, _ in scene.boxes.values())


def test_lids_have_boxes_and_samples_of_their_own(kit: FaceKit, scene: FaceScene, tmp_path: Path) -> None:
    bake = bake_of(kit, scene, replace(order(tmp_path), samples=Samples(1, 2, 4)))
    for shot in bake.levels:
        assert list(shot.boxes) == ["left", "right", "left_lids", "right_lids"]
        number = 8 if shot.pose.closure > LASHES_HANG else 4
        assert shot.finer == {"left_lids": number, "right_lids": number}
        assert shot.samples == 1
    for name, (x, y, width, height) in scene.boxes.items():
        lids = scene.lid_boxes[name]
        assert lids[0] >= x
        assert lids[0] + lids[2] <= x + width
        assert lids[1] >= y
        assert lids[1] + lids[3] <= y + height
        assert lids[2] * lids[3] < 0.75 * width * height
    assert "lids" not in "".join(bake_of(kit, scene, order(tmp_path)).levels[0].boxes)


def test_lids_boxes_hold_the_eyes_and_all_lashes(scene: FaceScene) -> None:
    for closure in (0.0, 0.5, 0.75, 0.9, 0.95, 1.0):
        for part in scene.shapes(LidPose(closure)):
            if part.material != "lash":
                continue
            at = scene.view.project(part.arrays()["points"].reshape(-1, 3).astype(float))
            x, y, width, height = scene.lid_boxes[part.name.rsplit("_", 1)[1]]
            low, high = np.array([x, y]), np.array([x + width, y + height])
            assert ((at > low - 1) & (at < high + 1)).all()


def test_no_iris_is_the_others_copy(scene: FaceScene) -> None:
    eyes = {part.name: part.shape for part in scene.parts(LidPose(0.0)) if part.name.startswith("eye_")}
    left, right = (eyes[f"eye_{side}"].uv for side in ("left", "right"))
    assert left is not None
    assert right is not None
    albedo, _ = eye_maps(scene.identity.iris, scene.identity.seed + 3, size=500)
    from_middle = np.linalg.norm(left - 0.5, axis=1) * 2 * TEXTURE_LIMIT * GLOBE_CM
    fibres = (from_middle > 0.5 * IRIS_CM) & (from_middle < 0.9 * IRIS_CM)
    shown = [albedo[tuple((uv[fibres, ::-1] * 500).astype(int).T)].mean(axis=1) for uv in (left, right)]
    assert np.corrcoef(shown)[0, 1] < 0.6  # what is left is the rings that all irises have


def test_skin_round_the_lids_keeps_the_still_frame(kit: FaceKit, scene: FaceScene, tmp_path: Path) -> None:
    bake = bake_of(kit, scene, replace(order(tmp_path, 3, 3), samples=Samples(1, 2, 4)))
    pretend_rendered(bake, 4)
    rng = np.random.default_rng(5)
    noise = {name: rng.uniform(0.28, 0.3, (box[3], box[2], 3)) for name, box in scene.boxes.items()}
    for shot in bake.levels:
        lids = {
            f"{name}_lids": np.full((box[3], box[2], 3), 0.3 - 0.2 * shot.pose.closure)
            for name, box in scene.lid_boxes.items()
        }
        np.savez(shot.file, **{k: v.astype(np.float16) for k, v in (noise | lids).items()})
    bake.write()
    atlas = load_atlas(tmp_path / "out")
    assert "--frame-samples 2 --lid-samples 4" in atlas.declaration.provenance["command"]
    levels = np.stack([atlas.level_srgb(k).astype(int) for k in range(3)])
    x0, y0 = atlas.declaration.crop[:2]
    around = np.ones(levels.shape[1:3], bool)
    for x, y, width, height in scene.lid_boxes.values():
        around[y - y0 : y - y0 + height, x - x0 : x - x0 + width] = False
    # One seed, one noise: it cancels, and of the coarse boxes nothing is left but the still frame.
    assert np.ptp(levels[:, around], axis=0).max() <= 2
    assert np.std(levels[0][around]) < 1
    assert levels[0][~around].mean() > levels[2][~around].mean() + 20


def test_each_box_is_rendered_with_its_own_samples(scene: FaceScene, tmp_path: Path) -> None:
    answer = (
        "print(json.dumps({'device': 'CPU'}), flush=True)\n"
        f"for line in sys.stdin: open({str(tmp_path / 'job')!r}, 'w').write(line); "
        "print(json.dumps({'seconds': 1}), flush=True)"
    )
    shot = Shot(tmp_path / "x.npz", LidPose(0.0), {"left": (0, 0, 2, 2), "left_lids": (0, 0, 1, 1)}, 3)
    shot = replace(shot, finer={"left_lids": 8})
    with Renderer(scene, Setup(program(tmp_path, answer), "studio", "cpu", 1, tmp_path / "log")) as renderer:
        renderer.render(shot)
    assert json.loads((tmp_path / "job").read_text())["samples"] == {"left": 3, "left_lids": 8}


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGTERM")
def test_a_bake_that_is_asked_to_end_ends_its_blender(scene: FaceScene, tmp_path: Path) -> None:
    body = (
        "import os, time\nprint(json.dumps({'device': 'CPU'}), flush=True)\nsys.stdin.readline()\n"
        f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()))\ntime.sleep(60)"
    )

    def bake() -> None:
        setup = Setup(program(tmp_path, body), "studio", "cpu", 1, tmp_path / "log")
        with Renderer(scene, setup) as renderer:
            renderer.render(Shot(tmp_path / "x.npz", LidPose(0.0), {"left": (0, 0, 2, 2)}, 1))

    baking = multiprocessing.get_context("fork").Process(target=bake)
    baking.start()
    while baking.is_alive() and not (tmp_path / "pid").exists():
        time.sleep(0.05)
    baking.terminate()
    baking.join(20)
    assert baking.exitcode == 128 + signal.SIGTERM
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_the_eyes_lie_60_mm_apart_and_the_rest_holds_still(scene: FaceScene) -> None:
    globes = scene.path.globes
    at = scene.view.project(np.stack([globes[1].centre, globes[-1].centre]) + np.array([0, 0, 1.0177]))
    assert abs(at[0, 0] - at[1, 0]) / scene.view.px_per_mm == pytest.approx(60.0, abs=0.3)
    assert 8.5 < scene.opening_mm < 11.5
    moved = scene.movement_mm()
    assert max(moved["brow"], moved["cheek"], abs(moved["lower_lid_nasal"])) < 0.05


def test_no_blink_changes_the_bridge_of_the_nose(scene: FaceScene) -> None:
    """Cedar's corners are so near it that noise and faint shade reached to 8.7 mm from its middle."""
    x, y, width, height = scene.boxes["left"]
    wide = (scene.view.size_px[0] // 2, y, x + width - scene.view.size_px[0] // 2, height)
    weight = scene.view.feather(wide)[height // 2, :, 0]
    away_mm = (wide[0] + np.arange(wide[2]) - scene.view.size_px[0] / 2) / scene.view.px_per_mm
    assert weight[away_mm < 9].max() == 0
    assert weight[(away_mm > 12) & (away_mm < 40)].min() == 1


def test_everything_moves_in_one_fixed_topology(scene: FaceScene) -> None:
    for opened, shut in zip(scene.parts(LidPose(0.0)), scene.parts(LidPose(0.6, 1.0, 3.0)), strict=True):
        assert opened.name == shut.name
        for key, value in opened.arrays().items():
            assert shut.arrays()[key].shape == value.shape
            if key not in MOVING:
                np.testing.assert_array_equal(shut.arrays()[key], value)
            assert np.isfinite(value).all()


def test_a_finished_bake_writes_a_character_without_blender(
    kit: FaceKit, scene: FaceScene, tmp_path: Path
) -> None:
    bake = bake_of(kit, scene, replace(order(tmp_path), name="face-12", seed=12))
    pretend_rendered(bake, 4)
    bake.run(lambda *_: None)
    atlas = load_atlas(tmp_path / "out")
    atlas.check_files()
    assert atlas.closures.tolist() == closures_of(9)
    darker = [atlas.level_srgb(k).mean() for k in (0, 4, 8)]
    assert darker[0] > darker[1] > darker[2]
    np.testing.assert_array_equal(atlas.level_srgb(0).shape[:2], atlas.base_linear()[atlas.crop].shape[:2])
    provenance = atlas.declaration.provenance
    assert provenance["rendered_closures"] == [0.0, 0.5, 1.0]
    assert provenance["command"].startswith("stimuli bake face --seed 12 --framing eyes --size 240x90 ")
    assert "ICT-FaceKit" in provenance["geometry"]
    assert atlas.declaration.inter_ocular_mm == 60.0
    assert "Permission is hereby granted" in (tmp_path / "out" / "ICT-FaceKit-LICENSE.txt").read_text()


def test_the_lower_lid_follows_the_ninth_level_and_makes_a_full_grid(
    kit: FaceKit, scene: FaceScene, tmp_path: Path
) -> None:
    wanted = FaceOrder(**(order(tmp_path, 17, 17).__dict__ | {"lower_lid": True}))
    bake = bake_of(kit, scene, wanted)
    assert [shot.file.name.split("_")[0] for shot in bake.shots] == (
        ["frame.npz"] + ["level"] * 9 + ["pose"] * 17 + ["level"] * 8
    )
    pretend_rendered(bake, 27)
    bake.write()
    lower = load_atlas(tmp_path / "out").lower_lid_layer
    assert lower.changes.shape[:2] == (5, 11)
    assert np.abs(lower.changes).max() < 0.01
    covered = [1 - lower.factor_at(k).mean() for k in (0, 16, 32)]
    assert covered[0] < covered[1] < covered[2]


def test_an_interrupted_bake_says_what_lacks_and_keeps_what_is_there(
    kit: FaceKit, scene: FaceScene, tmp_path: Path
) -> None:
    bake = bake_of(kit, scene, order(tmp_path))
    pretend_rendered(bake, 2)
    with pytest.raises(InputError, match="nothing to write: the still frame, the open and the closed level"):
        bake.write()
    assert len(list(bake.work.glob("*.npz"))) == 2
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", b"no picture"])
def test_a_damaged_shot_is_named_and_the_others_stay(
    kit: FaceKit, scene: FaceScene, tmp_path: Path, content: bytes
) -> None:
    bake = bake_of(kit, scene, order(tmp_path))
    pretend_rendered(bake, 4)
    bake.shots[3].file.write_bytes(content)
    with pytest.raises(
        InputError, match=r"level_0\.500000\.npz is damaged: delete it and bake again"
    ) as caught:
        bake.write()
    assert "\n" not in str(caught.value)
    np.savez(bake.shots[3].file, left=np.zeros((3, 4, 3), np.float16))
    with pytest.raises(InputError, match="holds other boxes than this bake's"):
        bake.write()
    assert bake.shots[2].file.exists()


def test_another_face_size_quality_or_light_is_other_work(kit: FaceKit, tmp_path: Path) -> None:
    first = order(tmp_path)
    places = {first.work_folder(kit)}
    for change in (
        {"identity": identity_of_seed(8)},
        {"size_px": (480, 180)},
        {"samples": Samples(2, 1)},
        {"samples": Samples(1, 1, 2)},
        {"light": "window"},
    ):
        places.add(FaceOrder(**(first.__dict__ | change)).work_folder(kit))
    assert len(places) == 6


def test_a_full_disk_is_said_in_one_line(
    kit: FaceKit, scene: FaceScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bake = bake_of(kit, scene, order(tmp_path))
    pretend_rendered(bake, 4)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="the disk is full: free up space and bake again; rendered levels"):
        bake.run(lambda *_: None)


def program(tmp_path: Path, body: str) -> Path:
    """A program in the place where Blender's Python would."""
    file = tmp_path / "python"
    file.write_text(f"#!{sys.executable}\nimport json, sys\n{body}\n")
    file.chmod(0o755)
    return file


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            "print(json.dumps({'error': 'CUDA error: device lost'}))",
            "CUDA error: device lost; what is rendered",
        ),
        ("sys.exit(3)", "it ended without output; what is rendered stays"),
    ],
)
def test_a_gpu_that_vanishes_is_said_in_one_line(
    scene: FaceScene, tmp_path: Path, body: str, said: str
) -> None:
    setup = Setup(program(tmp_path, body), "studio", "auto", 1, tmp_path / "log")
    with (
        pytest.raises(InputError, match=f"Blender stopped while starting: {said}.* --device cpu if the GPU"),
        Renderer(scene, setup),
    ):
        pass


def test_an_environment_of_before_gets_what_it_lacks_and_keeps_its_blender(tmp_path: Path) -> None:
    assert missing_packages(tmp_path) == list(PACKAGES)
    packages = tmp_path / "lib" / "python3.11" / "site-packages"
    (packages / "bpy-5.1.0.dist-info").mkdir(parents=True)
    assert missing_packages(tmp_path) == [package for package in PACKAGES if package.startswith("openexr")]
    (packages / "openexr-3.5.3.dist-info").mkdir()
    assert missing_packages(tmp_path) == []


@pytest.mark.skipif(NO_BLENDER, reason="Blender's environment .venv-bake is not whole here")
def test_blender_renders_a_shot_that_darkens_the_iris_behind_the_lid(
    kit: FaceKit, scene: FaceScene, tmp_path: Path
) -> None:
    bake = bake_of(kit, scene, order(tmp_path, 2, 2))
    with Renderer(scene, Setup(BLENDER, "studio", "cpu", 2, tmp_path / "log")) as renderer:
        for shot in bake.shots[1:]:
            renderer.render(shot)
    opened, shut = (shot.read()["left"].astype(float) for shot in bake.shots[1:])
    centre = tuple(slice(n // 2 - 2, n // 2 + 3) for n in opened.shape[:2])
    assert shut[centre].mean() > 1.5 * opened[centre].mean()


@pytest.mark.skipif(NO_BLENDER, reason="Blender's environment .venv-bake is not whole here")
def test_the_catchlight_is_no_matter_of_chance(kit: FaceKit, tmp_path: Path) -> None:
    """In a picture so large that a catchlight is more than edges, which are known to one of 32 samples."""
    scene, bright = FaceScene(kit, load_identity("alder"), "eyes", (480, 180)), []
    for seed in (1, 2):
        shot = Shot(tmp_path / f"{seed}.npz", LidPose(0.0), {"left": scene.lid_boxes["left"]}, 32)
        with Renderer(scene, Setup(BLENDER, "studio", "cpu", 2, tmp_path / "log", seed)) as renderer:
            renderer.render(shot)
        bright.append(_catchlight(scene, shot))
    assert bright[0] > 1
    assert bright[1] == pytest.approx(bright[0], rel=0.1)


def _catchlight(scene: FaceScene, shot: Shot) -> float:
    """Light of the brightest pixels within 3 mm of the left eye's middle: pupil and iris are dark."""
    x, y, _, _ = shot.boxes["left"]
    middle = scene.view.project(scene.path.globes[1].centre + np.array([0, 0, 1.3])) - (x, y)
    reach = round(3 * scene.view.px_per_mm)
    column, row = middle.round().astype(int)
    seen = shot.read()["left"][row - reach : row + reach, column - reach : column + reach]
    return float(np.sort(seen.astype(float).mean(-1), axis=None)[-4:].sum())


@pytest.mark.parametrize("name", ["alder", "birch", "cedar", "hazel"])
def test_declared_identities_are_whole(name: str) -> None:
    assert load_identity(name).label


def test_faults_of_identities_are_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no identity 'aldre' in identities.toml"):
        load_identity("aldre")
    with pytest.raises(InputError, match="seed must lie between 0 and 999999; it is 1000000"):
        identity_of_seed(1_000_000)
    file = tmp_path / "mine.toml"
    file.write_text(IDENTITIES_FILE.read_text().replace("age = 31", "age = 310"))
    with pytest.raises(InputError, match=r"mine.toml: alder.skin.age: expected at most 80, got 310"):
        load_identity("alder", file)
    file.write_text("not toml")
    with pytest.raises(InputError, match="is not TOML"):
        load_identity("alder", file)
    with pytest.raises(InputError, match="cannot read identities"):
        load_identity("alder", tmp_path / "none.toml")


def test_sizes_and_lights_are_checked() -> None:
    assert parse_size(None, "face") == FRAMINGS["face"].size_px
    assert parse_size("1920x720", "eyes") == (1920, 720)
    with pytest.raises(InputError, match="framing must be one of eyes, face; it is 'head'"):
        parse_size(None, "head")
    with pytest.raises(InputError, match="size 960x960 does not fit the framing 'eyes'"):
        parse_size("960x960", "eyes")
    with pytest.raises(InputError, match="size must be WIDTHxHEIGHT"):
        parse_size("big", "eyes")
    with pytest.raises(InputError, match="no light preset 'studoi'"):
        load_light("studoi")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--identity", "alder", "--seed", "4"], "use either --identity NAME or --seed NUMBER"),
        (["--seed", "-1"], "seed must lie between 0 and 999999; it is -1"),
        (["--identity", "alder", "--levels", "10"], "levels must be one of"),
        (["--identity", "alder", "--levels", "9", "--rendered", "17"], "cannot render 17 levels of an atlas"),
        (["--identity", "alder", "--device", "tpu"], "device must be one of auto, cpu, gpu; it is 'tpu'"),
        (["--identity", "alder"], "there is no face kit"),
    ],
)
def test_the_command_says_faults_in_one_line(tmp_path: Path, arguments: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["bake", "face", "--facekit", str(tmp_path), *arguments])
    assert result.exit_code != 0
    fault = str(result.exception) if isinstance(result.exception, InputError) else result.output
    assert said in " ".join(fault.split())
