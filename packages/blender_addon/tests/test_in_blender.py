"""The add-on as built, used in Blender itself: its curves are the engine's, the animator's keys stay."""

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from addon_build.addon import build

from blink_engine import Hold, perform
from blink_engine.speech import seed_of_speaker

ROOT = Path(__file__).resolve().parents[3]
BLENDER_PYTHON = ROOT / ".venv-bake" / "bin" / "python"
if not BLENDER_PYTHON.is_file():
    pytest.skip("Blender as a module (bpy) is not installed in .venv-bake", allow_module_level=True)


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("addon")
    script = Path(__file__).with_name("in_blender.py")
    ran = subprocess.run(
        [BLENDER_PYTHON, script, build(folder), folder],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    line = next(line for line in ran.stdout.splitlines() if line.startswith("RESULT"))
    return dict(json.loads(line.removeprefix("RESULT ")))


def test_the_curve_is_the_engines_at_every_frame(used: dict[str, Any]) -> None:
    engine = perform(600.0, 60.0, seed=seed_of_speaker(4, "Cube"), state="listening")
    assert used["fill"] == ["FINISHED"]
    assert used["left"] == pytest.approx(engine.left[:6000], abs=1e-4)
    # Nothing is keyed while the eye is at rest.
    assert used["keys"] < 0.4 * 36000


def test_names_are_guessed(used: dict[str, Any]) -> None:
    assert used["names"] == ["eyeBlinkLeft", "eyeBlinkRight"]
    assert used["bone_names"] == ["lid.T.L.002", "lid.T.R.002"]


def test_a_rig_without_lids_is_left_alone(used: dict[str, Any]) -> None:
    assert used["nothing_written"]


def test_names_of_no_known_scheme_are_guessed_and_shown(used: dict[str, Any]) -> None:
    assert used["unknown_scheme"] == ["FINISHED"]
    assert used["table"] == [
        ["by name", "MyEyesClose_L", "MyEyesClose_R"],
        ["by name", "winkL", "winkR"],
    ]


def test_keys_of_the_animator_are_touched_only_when_asked(used: dict[str, Any]) -> None:
    assert "has 1 manual keys in frames 1 to 41000" in used["own"]
    assert used["untouched"]
    assert used["own_outside"] == ["FINISHED"]
    assert used["own_kept"]
    assert used["removed"] == [[40000.0, 0.5]]


def test_one_blink_is_rolled_again_alone(used: dict[str, Any]) -> None:
    assert used["reroll"] == ["FINISHED"]
    first, last = used["changed"]
    assert last - first < 60 * 1.5
    assert "no generated blink at frame 39000" in used["reroll_nothing"]


def test_few_keys_are_fewer(used: dict[str, Any]) -> None:
    assert used["few"] < used["keys"] / 3


@pytest.mark.parametrize(
    ("case", "line"),
    [
        ("locked", "shape key 'eyeBlinkLeft' is locked"),
        ("driven", "is driven by another value"),
        ("mistyped", "has no shape key 'eyeBlnkLeft'"),
        ("silence", "there is no speech in that recording"),
        ("no_file", "no such file; expected a sound file"),
        ("no_sound", "expected a sound file that Blender reads"),
        ("bone_no_way", "set how far bone 'lid.T.L.002' moves to close the eye"),
        ("quaternion", "set its rotation mode to XYZ Euler"),
        ("flag_on", "'Eyes stay open' is on in the whole range"),
        ("no_lids", "no shape key or bone has a name for lids or blinks"),
        ("no_shapes", "choose what closes the left and the right eye"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(used: dict[str, Any], case: str, line: str) -> None:
    assert line in used[case]
    assert "\n" not in used[case].removeprefix("Error: ")


@pytest.mark.parametrize("case", ["locked_curve", "locked_group"])
def test_where_one_channel_is_locked_neither_is_written(used: dict[str, Any], case: str) -> None:
    said, untouched = used[case]
    assert "the channel of shape key 'eyeBlinkRight' is locked" in said
    assert untouched


def test_one_undo_takes_back_what_a_button_did(used: dict[str, Any]) -> None:
    assert set(used["undone"]) == {"fill", "blink", "from_speech", "guess", "reroll", "clear"}
    for button, (done, changed, as_before) in used["undone"].items():
        assert done == ["FINISHED"], button
        assert changed or button == "guess", button
        assert as_before, button


def test_blinks_come_while_the_keyed_flag_is_off(used: dict[str, Any]) -> None:
    assert used["flag"] == ["FINISHED"]
    closure = np.array(used["flagged"])
    assert (closure[199:500] == 0).all()
    assert closure[500:700].max() > 0.3
    engine = perform(
        20.0,
        60.0,
        seed=seed_of_speaker(5, "Cube"),
        state="speaking",
        holds=[Hold(199 / 60, 500 / 60)],
        ends_open=True,
    )
    assert closure == pytest.approx(engine.left, abs=1e-4)


def test_speech_is_answered(used: dict[str, Any]) -> None:
    assert used["speech"] == ["FINISHED"]


def test_a_bone_goes_the_way_it_was_given(used: dict[str, Any]) -> None:
    engine = perform(20.0, 60.0, seed=seed_of_speaker(1, "Armature"), state="rest", ends_open=True)
    assert np.array(used["bone_values"]) == pytest.approx(-0.01 * engine.left, abs=1e-6)
