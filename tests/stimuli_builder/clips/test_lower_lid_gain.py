"""How far the lower lid should move, and what the manifest says that moved."""

from pathlib import Path

import numpy as np
import pytest

from experiments.errors import InputError
from experiments.load import locate, parse_experiment
from stimuli_builder.clips.design_clips import Options, PlannedClip, SingleClip, planned_clips, render_single
from stimuli_builder.clips.folder import moved_mm

EXP3 = locate("exp3").read_text(encoding="utf-8")


def clip_of(gain: float) -> PlannedClip:
    """The first clip in which both signals move the lower lid."""
    text = EXP3.replace("[render]\n", f"[render]\nlower_lid_gain = {gain}\n", 1)
    experiment = parse_experiment(text.replace("per_cell = 20", "per_cell = 1"))
    return next(clip for clip in planned_clips(experiment, Options()) if clip.settings.lower_lid == "both")


def test_a_gain_scales_what_moves_the_lower_lid_and_nothing_else() -> None:
    whole, half, still = (clip_of(gain) for gain in (1.0, 0.5, 0.0))
    for name in ("lower_vertical_mm", "lower_horizontal_mm"):
        recorded = getattr(whole.job.curve, name)
        np.testing.assert_allclose(getattr(half.job.curve, name), recorded / 2, atol=1e-5)
        assert not getattr(still.job.curve, name).any()
    np.testing.assert_array_equal(half.job.curve.closure, whole.job.curve.closure)
    assert len({clip.job.input_hash for clip in (whole, half, still)}) == 3


def test_the_manifest_says_in_mm_what_moved() -> None:
    whole, still = moved_mm(clip_of(1.0)), moved_mm(clip_of(0.0))
    assert float(whole["lower_lid_lift_mm"]) > 0.1
    assert float(whole["lower_lid_slide_mm"]) > 1.0
    assert float(still["lower_lid_slide_mm"]) == 0.0
    # What the bake of alder@8 measured: brow and cheek hold still, the lower lid rises with the blink.
    assert whole["brow_mm"] == "0.000"
    assert float(whole["cheek_mm"]) < 0.02
    assert whole["lower_lid_up_mm"] == still["lower_lid_up_mm"] == "0.151"


def test_a_single_clip_has_the_gain_of_its_settings(tmp_path: Path) -> None:
    planned = clip_of(1.0).settings
    curves = [
        render_single(
            SingleClip(
                planned.model_copy(update={"lower_lid_gain": gain, "width_px": 320, "height_px": 120}), "real"
            ),
            tmp_path / f"{gain}.mp4",
        ).curve
        for gain in (1.0, 0.5)
    ]
    whole, half = (curve.lower_horizontal_mm for curve in curves)
    assert whole is not None
    assert half is not None
    np.testing.assert_allclose(half, whole / 2, atol=1e-5)
    assert whole.any()


def test_motion_beyond_what_was_baked_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r"its character is baked for 0 to 1 mm\. Bake a larger range"):
        clip_of(3.0)
