"""Exports read back by programs that were not written here, and compared with the engine."""

import json
from pathlib import Path

import numpy as np
import pytest

from blink_engine import Performance, perform
from stimuli_builder.blinks.export.formats import CurveTarget, write_curve
from stimuli_builder.performance.run import animation_curve

FPS = 24.0
TIMES = np.linspace(0.3, 19.0, 10)


@pytest.fixture(scope="module")
def done() -> Performance:
    return perform(20.0, FPS, seed=8, state="speaking")


def at(done: Performance, time_s: float) -> tuple[float, float]:
    """Both closures at a time, straight between frames."""
    frames = np.arange(done.left.size) / FPS
    return float(np.interp(time_s, frames, done.left)), float(np.interp(time_s, frames, done.right))


def test_usd_is_read_by_pixars_library(tmp_path: Path, done: Performance) -> None:
    usd = pytest.importorskip("pxr.Usd", reason="usd-core has no wheel for this machine")
    skel = pytest.importorskip("pxr.UsdSkel", reason="usd-core has no wheel for this machine")
    path = tmp_path / "blinks.usda"
    path.write_text(write_curve("usd", animation_curve(done), CurveTarget("head")), encoding="utf-8")
    stage = usd.Stage.Open(str(path))
    animation = skel.Animation(stage.GetPrimAtPath("/head/blinks"))
    assert list(animation.GetBlendShapesAttr().Get()) == ["eyeBlinkLeft", "eyeBlinkRight"]
    assert stage.GetTimeCodesPerSecond() == FPS
    for time_s in TIMES:
        read = animation.GetBlendShapeWeightsAttr().Get(time_s * FPS)
        np.testing.assert_allclose(list(read), at(done, time_s), atol=1e-4)


def test_gltf_holds_the_curve(done: Performance) -> None:
    import base64

    content = json.loads(write_curve("gltf", animation_curve(done), CurveTarget()))
    data = base64.b64decode(content["buffers"][0]["uri"].split(",", 1)[1])
    assert len(data) == content["buffers"][0]["byteLength"]
    sampler = content["animations"][0]["samplers"][0]

    def values(accessor: int) -> np.ndarray:
        view = content["bufferViews"][content["accessors"][accessor]["bufferView"]]
        return np.frombuffer(data, "<f4", content["accessors"][accessor]["count"], view["byteOffset"])

    times, weights = values(sampler["input"]), values(sampler["output"]).reshape(-1, 2)
    for time_s in TIMES:
        read = [np.interp(time_s, times, weights[:, eye]) for eye in range(2)]
        np.testing.assert_allclose(read, at(done, time_s), atol=1e-4)
