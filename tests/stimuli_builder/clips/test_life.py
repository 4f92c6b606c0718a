"""Motion between blinks, measured in decoded frames by phase correlation: it knows nothing of the painter."""

from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.load import parse_experiment
from experiments.manifest import read_manifest
from stimuli_builder.clips.build import build
from stimuli_builder.clips.characters import geometry
from stimuli_builder.clips.cli_clip import settings_from
from stimuli_builder.clips.design_clips import Options, SingleClip, planned_clips, render_single
from stimuli_builder.clips.life import Life, draw_life
from stimuli_builder.clips.verify import verify

PER_FRAME_MM, WITHIN_2_S_MM = (0.09, 0.29), (0.2, 0.7)
"""What five recordings of talking heads show at 25 to 30 fps: mean motion, and SD of the place."""
STUDY = """
name = "alive"
title = "Still and alive eyes"

[[factors]]
name = "life"
label = "Life"
[[factors.levels]]
name = "still"
label = "Still"
[[factors.levels]]
name = "alive"
label = "Alive"
render = { life = 1.0 }

[render]
character = "CHARACTER"
profile = "model"
lower_lid = "none"
width_px = 480
height_px = 180

[exemplars]
per_cell = 1
own_per = []

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


def rendered(folder: Path, character: str, life: float, frames: int, seed: int = 2011) -> Path:
    out = folder / f"{character}-{life}-{seed}.mp4"
    settings = settings_from(character=character, life=life)
    render_single(SingleClip(settings, "model", seed=seed, clip_frames=frames), out)
    return out


def gray_frames(clip: Path) -> NDArray[np.float32]:
    with av.open(str(clip)) as container:
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]
    return np.array(frames, np.float32)


def path_mm(frames: NDArray[np.float32], px_per_mm: float) -> NDArray[np.float64]:
    """(frames, 2) place of the head, from the forehead between the brows down the nose."""
    height, width = frames.shape[1:]
    # The bridge of the nose: no lid, iris or brow moves there.
    nose = frames[:, height // 8 :, width * 2 // 5 : width * 3 // 5].copy()
    window = cv2.createHanningWindow(nose.shape[2:0:-1], cv2.CV_32F)
    steps = [cv2.phaseCorrelate(nose[0], frame, window)[0] for frame in nose]
    return np.array(steps) / px_per_mm


@pytest.mark.parametrize("character", ["alder@8", "cartoon"])
def test_motion_between_blinks_is_as_in_recordings(tmp_path: Path, character: str) -> None:
    frames = gray_frames(rendered(tmp_path, character, 1.0, 180))[-60:]  # 2 s of open eyes
    place = path_mm(frames, geometry(character).px_per_mm_at(960))
    per_frame = float(np.linalg.norm(np.diff(place, axis=0), axis=1).mean())
    assert PER_FRAME_MM[0] <= per_frame <= PER_FRAME_MM[1]
    assert WITHIN_2_S_MM[0] <= float(np.sqrt((place.std(axis=0) ** 2).sum())) <= WITHIN_2_S_MM[1]


def test_motion_drawn_for_many_seeds_stays_in_range() -> None:
    for seed in range(40):
        head = draw_life(3000, 1.0, seed).head_mm.reshape(-1, 10, 2).mean(axis=1)
        per_frame = float(np.linalg.norm(np.diff(head, axis=0), axis=1).mean())
        within = float(np.sqrt((head.reshape(-1, 60, 2).std(axis=1) ** 2).sum(axis=-1)).mean())
        assert PER_FRAME_MM[0] <= per_frame <= PER_FRAME_MM[1]
        assert WITHIN_2_S_MM[0] <= within <= WITHIN_2_S_MM[1]


def test_strength_scales_every_part_and_a_seed_repeats_it() -> None:
    whole, half, again = draw_life(600, 1.0, 5), draw_life(600, 0.5, 5), draw_life(600, 1.0, 5)
    for name in ("head_mm", "roll_deg", "gaze_mm", "pupil"):
        np.testing.assert_allclose(getattr(half, name), getattr(whole, name) / 2)
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert half.noise_codes == whole.noise_codes / 2
    assert not np.array_equal(draw_life(600, 1.0, 6).head_mm, whole.head_mm)


def test_saccades_have_the_speed_of_saccades() -> None:
    life: Life = draw_life(30 * 300, 1.0, 3)
    speed_deg_s = 300 * np.linalg.norm(np.diff(life.gaze_mm, axis=0), axis=1) / 0.2
    # A shift of 1 to 4 degrees peaks at 60 to 250 degrees per second (Bahill et al. 1975); drift below 2.
    assert 60 < speed_deg_s.max() < 300
    assert np.median(speed_deg_s) < 2


def test_life_zero_is_the_clip_of_before(tmp_path: Path) -> None:
    still = rendered(tmp_path, "cartoon", 0.0, 60)
    before = tmp_path / "before.mp4"
    render_single(SingleClip(settings_from(character="cartoon"), "model", clip_frames=60), before)
    assert still.read_bytes() == before.read_bytes()
    first, second = (rendered(tmp_path / name, "cartoon", 1.0, 60) for name in (".", ".."))
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("character", ["alder@8", "cartoon"])
def test_factor_of_life_keeps_the_blink_and_passes_verification(tmp_path: Path, character: str) -> None:
    experiment = parse_experiment(STUDY.replace("CHARACTER", character))
    still, alive = planned_clips(experiment, Options())
    assert still.job.curve.profile_id == alive.job.curve.profile_id
    assert still.job.curve.closure.max() == pytest.approx(alive.job.curve.closure.max(), abs=0.01)
    assert "life" not in still.job.look.hashed()
    build(experiment, tmp_path)
    verdict = verify(tmp_path)
    assert verdict.findings == ()
    assert verdict.opening_checked == 2
    said = [clip.inputs.get("life") for clip in read_manifest(tmp_path).clips]
    assert said == [None, "1.0"]
