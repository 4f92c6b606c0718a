"""An exported performance as others read it: the glTF validator, and three.js playing the animation."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from blink_engine import perform
from stimuli_builder.performance.run import PerformanceJob, write_performance

FRONTEND = Path(__file__).resolve().parents[3] / "frontend"
FPS, SECONDS = 60.0, 30.0


def test_the_animation_is_valid_and_plays_as_the_engine(tmp_path: Path) -> None:
    made = tmp_path / "blinks.gltf"
    write_performance(PerformanceJob(made, None, "gltf", FPS, 7, "speaking", SECONDS))
    engine = perform(SECONDS, FPS, seed=7, state="speaking")
    # Ten moments within blinks, where a frame or a sign lost would show.
    frames = np.flatnonzero(engine.left > 0.05)
    frames = frames[np.linspace(0, frames.size - 1, 10).astype(int)]
    script = FRONTEND / "tests" / "importers" / "gltf.mjs"
    command = ["node", script, made, *[f"{frame / FPS:.9f}" for frame in frames]]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, cwd=FRONTEND, timeout=120)
    assert ran.returncode == 0, ran.stderr
    read = json.loads(ran.stdout)
    assert (read["issues"]["numErrors"], read["issues"]["numWarnings"]) == (0, 0)
    assert read["targets"] == {"eyeBlinkLeft": 0, "eyeBlinkRight": 1}
    assert read["duration_s"] == pytest.approx(SECONDS - 1 / FPS, abs=1e-4)
    expected = np.column_stack([engine.left[frames], engine.right[frames]])
    np.testing.assert_allclose(read["values"], expected, atol=1e-4)
