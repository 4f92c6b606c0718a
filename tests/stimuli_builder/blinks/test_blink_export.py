import ast
import csv
import io
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.blink_model import default_model, textbook_profile
from stimuli_builder.blinks.export import (
    BLEND_SHAPES,
    CSV_COLUMNS,
    make_curve,
    time_unit,
    timecode,
    to_arkit,
    to_blender,
    to_csv,
    to_json,
    to_maya,
)
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import to_full_closure

BLENDER_PYTHON = Path(__file__).parents[3] / ".venv-bake" / "bin" / "python"


@pytest.fixture(scope="module")
def curve():
    """Three blinks of both eyes at 30 fps."""
    return make_curve(load_library(paired=True)[1:4], 30, lead_s=0.5, seed=3)


def test_the_minimum_falls_on_a_frame():
    for fps in (24, 30, 60):
        assert make_curve([textbook_profile("SL", 7.3)], fps).left.max() == 1.0


def test_blinks_follow_at_natural_intervals():
    blinks = [default_model().sample(rng=np.random.default_rng(k)) for k in range(300)]
    curve = make_curve(blinks, 30, seed=1)
    onsets = np.array([onset for _, onset in curve.blinks])
    assert np.median(np.diff(onsets)) / 30 == pytest.approx(3.4, abs=0.5)


def test_a_curve_begins_and_ends_open(curve):
    assert curve.left[0] == curve.left[-1] == curve.right[0] == curve.right[-1] == 0


def test_left_and_right_keep_their_asymmetry(curve):
    assert np.abs(curve.left - curve.right).max() > 0.02


@pytest.mark.parametrize(("fps", "lead"), [(0, 0), (float("nan"), 0), (30, -1), (5000, 0)])
def test_impossible_curves_are_refused(fps, lead):
    with pytest.raises(InputError, match="must be between"):
        make_curve([textbook_profile("SL", 9)], fps, lead)


def test_csv_is_read_back(curve):
    rows = list(csv.DictReader(io.StringIO(to_csv(curve))))
    assert list(rows[0]) == list(CSV_COLUMNS)
    assert [float(row["closure_left"]) for row in rows] == pytest.approx(curve.left)
    assert [float(row["closure_right"]) for row in rows] == pytest.approx(curve.right)
    assert float(rows[30]["time_s"]) == pytest.approx(1.0)


def test_json_is_read_back(curve):
    content = json.loads(to_json(curve))
    assert content["fps"] == 30
    assert content["closure_left"] == pytest.approx(curve.left)
    assert [blink["profile_id"] for blink in content["blinks"]] == [name for name, _ in curve.blinks]


def test_arkit_is_read_back(curve):
    rows = list(csv.DictReader(io.StringIO(to_arkit(curve))))
    assert len(rows[0]) == 63
    assert len(BLEND_SHAPES) == len(set(BLEND_SHAPES)) == 61
    assert {row["BlendShapeCount"] for row in rows} == {"61"}
    assert [float(row["EyeBlinkLeft"]) for row in rows] == pytest.approx(curve.left, abs=1e-6)
    assert [float(row["EyeBlinkRight"]) for row in rows] == pytest.approx(curve.right, abs=1e-6)
    others = set(BLEND_SHAPES) - {"EyeBlinkLeft", "EyeBlinkRight"}
    assert {float(row[name]) for row in rows for name in others} == {0.0}


@pytest.mark.parametrize(
    ("frame", "fps", "expected"),
    [
        (0, 30, "00:00:00:00.000"),
        (59, 30, "00:00:01:29.000"),
        (108_000, 30, "01:00:00:00.000"),
        (30, 29.97, "00:00:01:00.030"),
    ],
)
def test_timecodes(frame, fps, expected):
    assert timecode(frame, fps) == expected


KEY = re.compile(r"^\s+(\d+) (\S+) linear linear 1 1 0;$", re.MULTILINE)
CURVE = re.compile(r"anim (\S+) (\S+) (\S+) 0 0 (\d+);\nanimData \{(.*?)\n\}\n", re.DOTALL)


def test_maya_is_read_back(curve):
    text = to_maya(curve, "head")
    assert text.startswith("animVersion 1.1;\nmayaVersion")
    assert "timeUnit ntsc;" in text
    assert f"endTime {curve.left.size - 1};" in text
    found = {match[0]: (match[2], KEY.findall(match[4])) for match in CURVE.findall(text)}
    assert set(found) == {"eyeBlinkLeft", "eyeBlinkRight"}
    for name, expected in (("eyeBlinkLeft", curve.left), ("eyeBlinkRight", curve.right)):
        node, keys = found[name]
        assert node == "head"
        assert [int(frame) for frame, _ in keys] == list(range(curve.left.size))
        assert [float(value) for _, value in keys] == pytest.approx(expected, abs=1e-6)
    assert text.count("{") == text.count("}")


@pytest.mark.parametrize(
    ("fps", "unit"), [(24, "film"), (25, "pal"), (30, "ntsc"), (60, "ntscf"), (300, "300fps")]
)
def test_maya_names_its_rates(fps, unit):
    assert time_unit(fps) == unit


def test_maya_refuses_a_rate_without_a_name():
    with pytest.raises(InputError, match="nearest is --fps 30"):
        time_unit(29.97)


def _constant(script, name):
    for node in ast.parse(script).body:
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Name)
            and node.targets[0].id == name
        ):
            return ast.literal_eval(node.value)
    raise KeyError(name)


def test_the_blender_script_holds_the_curve(curve):
    script = to_blender(curve, "Head 'x'")
    curves = _constant(script, "CURVES")
    assert curves["eyeBlinkLeft"] == pytest.approx(curve.left)
    assert curves["eyeBlinkRight"] == pytest.approx(curve.right)
    assert _constant(script, "OBJECT") == "Head 'x'"
    assert _constant(script, "FPS") == 30


def test_the_script_runs_in_blender_itself(tmp_path):
    if not BLENDER_PYTHON.is_file():
        pytest.skip("Blender as a module (bpy) is not installed in .venv-bake")
    curve = make_curve([to_full_closure(load_library()[3])], 30)
    (tmp_path / "blink.py").write_text(to_blender(curve), encoding="utf-8")
    check = (
        "import bpy, runpy, sys, json\n"
        "bpy.context.view_layer.objects.active = bpy.data.objects['Cube']\n"
        f"blink = runpy.run_path({str(tmp_path / 'blink.py')!r})\n"
        "keys = bpy.data.objects['Cube'].data.shape_keys\n"
        "curves = {c.data_path: c for c in blink['f_curves'](keys.animation_data)}\n"
        "points = curves['key_blocks[\"eyeBlinkLeft\"].value'].keyframe_points\n"
        "print('RESULT', json.dumps([[p.co[0], p.co[1], p.interpolation] for p in points]))\n"
    )
    ran = subprocess.run(
        [BLENDER_PYTHON, "-c", check], capture_output=True, text=True, timeout=300, check=False
    )
    assert ran.returncode == 0, ran.stderr
    line = next(line for line in ran.stdout.splitlines() if line.startswith("RESULT"))
    points = json.loads(line.removeprefix("RESULT "))
    assert [point[0] for point in points] == list(range(1, curve.left.size + 1))
    assert [point[1] for point in points] == pytest.approx(curve.left, abs=1e-5)
    assert {point[2] for point in points} == {"LINEAR"}
