"""The snippets for Unity and Unreal in docs/explanation/blink-engine.md, against stand-ins for both.

Neither program can be had from a registry: this shows that the snippets themselves contain no mistakes.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from blink_engine import perform
from stimuli_builder.performance.run import PerformanceJob, write_performance
from tests.conftest import REPOSITORY

FPS, SECONDS = 60.0, 20.0
STUBS = Path(__file__).with_name("unity") / "Stubs.cs"


def snippet(language: str, naming: str) -> str:
    """The block of the page in this language that names something."""
    text = (REPOSITORY / "docs" / "explanation" / "blink-engine.md").read_text(encoding="utf-8")
    blocks = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    return next(block for block in blocks if naming in block)


def write(path: Path, format_name: str) -> Path:
    write_performance(PerformanceJob(path, None, format_name, FPS, 7, "speaking", SECONDS))
    return path


def test_unitys_snippet_compiles_and_sets_the_engines_lids(tmp_path: Path) -> None:
    if shutil.which("mcs") is None or shutil.which("mono") is None:
        pytest.skip("no C# compiler here: sudo apt-get install mono-mcs")
    source, program = tmp_path / "PalpebraBlinks.cs", tmp_path / "blinks.exe"
    source.write_text(snippet("csharp", "PalpebraBlinks"), encoding="utf-8")
    subprocess.run(["mcs", "-warnaserror", "-nowarn:0649", f"-out:{program}", source, STUBS], check=True)
    engine = perform(SECONDS, FPS, seed=7, state="speaking")
    frames = np.flatnonzero(engine.left > 0.05)
    frames = frames[np.linspace(0, frames.size - 1, 10).astype(int)]
    times = [f"{frame / FPS:.7f}" for frame in frames]
    command = ["mono", program, write(tmp_path / "blinks.json", "json"), *times]
    told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    weights = [[float(one) for one in line.split()] for line in told.splitlines()]
    expected = 100 * np.column_stack([engine.left[frames], engine.right[frames]])
    np.testing.assert_allclose(weights, expected, atol=0.02)


def test_unreals_snippet_adds_the_engines_curves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "blinks.csv", "csv")
    monkeypatch.chdir(tmp_path)
    keys: dict[str, tuple[list[float], list[float]]] = {}
    unreal = ModuleType("unreal")
    unreal.EditorAssetLibrary = SimpleNamespace(load_asset=lambda path: path)  # type: ignore[attr-defined]
    unreal.RawCurveTrackTypes = SimpleNamespace(RCT_FLOAT=0)  # type: ignore[attr-defined]
    unreal.AnimationLibrary = SimpleNamespace(  # type: ignore[attr-defined]
        add_curve=lambda sequence, name, kind: keys.setdefault(name, ([], [])),
        add_float_curve_keys=lambda sequence, name, times, values: keys.update({name: (times, values)}),
    )
    monkeypatch.setitem(sys.modules, "unreal", unreal)
    exec(compile(snippet("python", "import unreal"), "snippet", "exec"), {})
    engine = perform(SECONDS, FPS, seed=7, state="speaking")
    assert set(keys) == {"CTRL_expressions_eyeBlinkL", "CTRL_expressions_eyeBlinkR"}
    times, values = keys["CTRL_expressions_eyeBlinkR"]
    np.testing.assert_allclose(times, np.arange(engine.right.size) / FPS, atol=1e-5)
    np.testing.assert_allclose(values, engine.right, atol=1e-4)
