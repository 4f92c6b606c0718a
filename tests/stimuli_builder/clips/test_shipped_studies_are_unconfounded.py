"""Nothing outside the factors of a shipped study separates its levels."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ks_2samp

from experiments.level_leaks import BRIGHTNESS, reported_leaks
from experiments.load import DEMOS, SHIPPED, load_experiment
from experiments.manifest import Clip, read_manifest
from stimuli_builder.blinks.library import load_library
from stimuli_builder.clips.build import Machines, build
from stimuli_builder.clips.design_clips import Options, PlannedClip, planned_clips
from stimuli_builder.clips.folder import clip_onset_frame, clip_samples
from stimuli_builder.clips.verify import verify


def clip_of(planned: PlannedClip) -> Clip:
    """The manifest's clip without its rendering: all that raters may notice but brightness."""
    curve, settings = planned.job.curve, planned.settings
    return Clip(
        levels=dict(planned.spec.levels),
        cell=planned.spec.cell,
        exemplar=planned.spec.exemplar,
        file="not-rendered.mp4",
        sha256=planned.job.input_hash,
        bytes=1,
        fps=settings.fps,
        frames=planned.job.frames,
        width_px=settings.width_px,
        height_px=settings.height_px,
        profile=curve.profile_id,
        duration_frames=None if settings.performance else curve.duration_frames,
        onset_frame=clip_onset_frame(curve, settings),
        closure=clip_samples(curve.closure),
        closure_other=clip_samples(curve.closure_other),
        lower_vertical_mm=clip_samples(curve.lower_vertical_mm),
        lower_horizontal_mm=clip_samples(curve.lower_horizontal_mm),
        inputs={"character": settings.character},
    )


@pytest.mark.parametrize("name", [*SHIPPED, *DEMOS])
def test_nothing_outside_the_factors_predicts_a_level(name: str) -> None:
    experiment = load_experiment(name)
    assert reported_leaks([clip_of(clip) for clip in planned_clips(experiment, Options())]) == []


@pytest.mark.parametrize("name", [*SHIPPED, *DEMOS])
def test_single_blinks_begin_and_end_with_all_lids_at_rest(name: str) -> None:
    for planned in planned_clips(load_experiment(name), Options()):
        if planned.settings.performance is None:
            curve = planned.job.curve
            for signal in (
                curve.closure,
                curve.closure_other,
                curve.lower_vertical_mm,
                curve.lower_horizontal_mm,
            ):
                assert signal is None or abs(signal[[0, -1]]).max() < 1e-4, planned.spec.cell


PROFILES = """
name = "rests"
title = "Profiles"

[[factors]]
name = "profile"
label = "Profile"
levels = [
    { name = "phases", label = "Phases", render = { profile = "phases" } },
    { name = "model", label = "Model", render = { profile = "model" } },
    { name = "SL", label = "SL", render = { profile = "SL" } },
]

[exemplars]
per_cell = 4
own_per = ["profile"]

[render]
character = "cartoon"
duration_frames = 7
width_px = 320
height_px = 120

[trial]
kind = "clip_rating"
[trial.scale]
question = { en = "How natural?" }
low = { en = "very unnatural" }
high = { en = "very natural" }

[texts.en]
consent = "c"
instructions = "i"
debrief = "d"
"""


def test_first_and_last_frames_of_built_clips_are_equally_bright(tmp_path: Path) -> None:
    (tmp_path / "rests.toml").write_text(PROFILES)
    build(load_experiment(str(tmp_path / "rests.toml")), tmp_path / "clips", Options(), Machines(1))
    verdict = verify(tmp_path / "clips")
    assert len(read_manifest(tmp_path / "clips").clips) == 12
    judged = {leak.feature for leak in verdict.leaks}
    assert set(BRIGHTNESS) <= judged
    assert [leak for leak in verdict.leaks if leak.reported] == []


@pytest.mark.parametrize(
    ("feature", "worst"), [("peak closure", 0.3), ("opening speed", 0.35), ("closing speed", 0.3)]
)
def test_blinks_of_exp1_close_and_move_as_recorded_ones(feature: str, worst: float) -> None:
    """Natural closure: Kolmogorov-Smirnov; the PCA model has .34, .50 and .37."""
    shown = {"real": [], "model": []}
    for planned in planned_clips(load_experiment("exp1"), Options()):
        levels = dict(planned.spec.levels)
        if (levels["character"], levels["blur"], levels["amplitude"]) == ("cartoon", "MB", "NC"):
            closure = planned.job.curve.closure
            speeds = np.diff(closure)
            values = {
                "peak closure": closure.max(),
                "opening speed": -speeds.min(),
                "closing speed": speeds.max(),
            }
            shown[levels["profile"]].append(values[feature])
    assert len(shown["model"]) == 20
    assert ks_2samp(shown["real"], shown["model"]).statistic <= worst
    assert len(load_library()) >= 20
