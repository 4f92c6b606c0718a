"""An exported performance as others read it: the glTF validator, three.js, USD's own library, Blender."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from blink_engine import Performance, perform
from stimuli_builder.performance.run import PerformanceJob, write_performance

ROOT = Path(__file__).resolve().parents[3]
FRONTEND, BLENDER_PYTHON = ROOT / "frontend", ROOT / ".venv-bake" / "bin" / "python"
FPS, SECONDS = 60.0, 30.0
AT_FRAMES = """
import bpy, json, runpy, sys
bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
runpy.run_path(sys.argv[1])
keys = bpy.data.objects["Cube"].data.shape_keys.key_blocks
seen = []
for frame in json.loads(sys.argv[2]):
    bpy.context.scene.frame_set(frame + 1)
    seen.append([keys["eyeBlinkLeft"].value, keys["eyeBlinkRight"].value])
print("RESULT", json.dumps([bpy.context.scene.render.fps, seen]))
"""


@pytest.fixture(scope="module")
def engine() -> Performance:
    return perform(SECONDS, FPS, seed=7, state="speaking")


@pytest.fixture(scope="module")
def ten(engine: Performance) -> list[int]:
    """Ten frames within blinks, where a frame or a sign lost would show."""
    frames = np.flatnonzero(engine.left > 0.05)
    return [int(frame) for frame in frames[np.linspace(0, frames.size - 1, 10).astype(int)]]


def lids(engine: Performance, frames: list[int]) -> np.ndarray:
    return np.column_stack([engine.left[frames], engine.right[frames]])


def write(path: Path, format_name: str) -> Path:
    write_performance(PerformanceJob(path, None, format_name, FPS, 7, "speaking", SECONDS))
    return path


def test_the_animation_is_valid_and_plays_as_the_engine(
    tmp_path: Path, engine: Performance, ten: list[int]
) -> None:
    made = write(tmp_path / "blinks.gltf", "gltf")
    script = FRONTEND / "tests" / "importers" / "gltf.mjs"
    command = ["node", script, made, *[f"{frame / FPS:.9f}" for frame in ten]]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, cwd=FRONTEND, timeout=120)
    assert ran.returncode == 0, ran.stderr
    read = json.loads(ran.stdout)
    assert (read["issues"]["numErrors"], read["issues"]["numWarnings"]) == (0, 0)
    assert read["targets"] == {"eyeBlinkLeft": 0, "eyeBlinkRight": 1}
    assert read["duration_s"] == pytest.approx(SECONDS - 1 / FPS, abs=1e-4)
    np.testing.assert_allclose(read["values"], lids(engine, ten), atol=1e-4)


def test_usd_opens_the_layer_and_reads_the_engines_lids(
    tmp_path: Path, engine: Performance, ten: list[int]
) -> None:
    usd = pytest.importorskip("pxr.Usd", reason="usd-core has no wheel for this machine")
    from pxr import UsdSkel

    stage = usd.Stage.Open(str(write(tmp_path / "blinks.usda", "usd")))
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (FPS, SECONDS * FPS - 1)
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/face/blinks"))
    assert list(animation.GetBlendShapesAttr().Get()) == ["eyeBlinkLeft", "eyeBlinkRight"]
    weights = animation.GetBlendShapeWeightsAttr()
    np.testing.assert_allclose([list(weights.Get(frame)) for frame in ten], lids(engine, ten), atol=1e-4)


def test_blender_plays_the_engines_lids(tmp_path: Path, engine: Performance, ten: list[int]) -> None:
    if not BLENDER_PYTHON.is_file():
        pytest.skip("Blender as a module (bpy) is not installed in .venv-bake")
    command = [BLENDER_PYTHON, "-c", AT_FRAMES, write(tmp_path / "blinks.py", "blender"), json.dumps(ten)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, ran.stderr
    line = next(line for line in ran.stdout.splitlines() if line.startswith("RESULT"))
    fps, values = json.loads(line.removeprefix("RESULT "))
    assert fps == FPS
    np.testing.assert_allclose(values, lids(engine, ten), atol=1e-4)
