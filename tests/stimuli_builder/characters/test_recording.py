"""A character from a recording: against a generated one of known truth, on real eyes, and on bad input."""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.characters.atlas import load_atlas
from stimuli_builder.characters.recording_bake import RecordingBake, RecordingOrder, bake_recording
from stimuli_builder.characters.recording_levels import near_both_sides
from stimuli_builder.characters.recording_lids import EDGE_ROWS, lid_opening, lid_travel, seen_margins
from stimuli_builder.cli import main
from stimuli_builder.clips.build import Machines, build
from stimuli_builder.clips.characters import find_character
from stimuli_builder.clips.design_clips import Options
from stimuli_builder.clips.verify import verify
from stimuli_builder.tracking.cli_track import TrackJob, run_track
from stimuli_builder.tracking.model import TrainingOptions
from tests.stimuli_builder.characters.recordings import Recording

SMALL = Recording(width_px=480, seconds=1.0, onsets=(0.3,))
"""Quickly baked; its eyes are small, which is one of its stated limits."""


def bake(recording: Recording, folder: Path) -> RecordingBake:
    video, track = recording.write(folder)
    return bake_recording(RecordingOrder(video, folder / "made", track))


def decibels(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    return float(10 * np.log10(255**2 / ((one - other) ** 2).mean()))


# Known truth.


@dataclass(frozen=True)
class Made:
    recording: Recording
    folder: Path
    baked: RecordingBake


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("recorded")
    recording = Recording()
    return Made(recording, folder / "made", bake(recording, folder))


def test_left_out_frames_come_back_at_every_closure(made: Made) -> None:
    values = made.baked.left_out[1:-1]
    assert len(values) >= 15
    assert values.min() >= 38
    assert made.baked.limits == []


def test_levels_show_the_true_face_and_its_opening(made: Made) -> None:
    atlas = load_atlas(made.folder)
    assert len(atlas.closures) >= 17
    x, y, width, height = atlas.declaration.crop
    base, region = made.baked.frames.numbers[0], made.baked.frames.region

    def truth(closure: float) -> NDArray[np.float32]:
        return region.cut(made.recording.truth(closure, base))[y : y + height, x : x + width]

    for index in [*range(0, len(atlas.closures), 8), len(atlas.closures) - 1]:
        level, closure = atlas.level_srgb(index).astype(np.float32), float(atlas.closures[index])
        offsets = np.arange(-0.03, 0.0301, 0.0025)
        alike = [decibels(level, truth(float(np.clip(closure + off, 0, 1)))) for off in offsets]
        assert max(alike) >= 40, closure
        assert abs(offsets[int(np.argmax(alike))]) * 11.0 <= 0.2, closure


def test_the_tracker_confirms_every_opening(made: Made) -> None:
    assert np.abs(made.baked.measured.off_mm).max() <= 0.2
    assert made.baked.opening_mm == pytest.approx(9.5, abs=0.3)


def test_openings_without_labels_are_those_of_the_lids(tmp_path: Path) -> None:
    recording = Recording(face="alder-face@4", width_px=480, fps=120, seconds=0.7, onsets=(0.1,))
    recording.write(tmp_path)
    baked = bake_recording(RecordingOrder(tmp_path / "person.mp4", tmp_path / "made"))
    recorded = [k for k, level in enumerate(baked.levels) if level.first == level.second]
    off = baked.measured.closures[recorded] - recording.closure[baked.frames.numbers]
    opening_mm = find_character(recording.face).geometry.opening_mm
    # The detector's lids were up to 1.8 mm off here.
    assert np.abs(off).max() * opening_mm <= 0.3
    # These lids slide 0.4 to 0.6 mm over one another once they have met. By their motion alone, that counted
    # as opening, which was 0.43 mm too large. The command states 0.5 mm.
    assert baked.opening_mm == pytest.approx(opening_mm, abs=0.35)
    assert "without labels" in (tmp_path / "made" / "report.html").read_text(encoding="utf-8")


def test_a_close_up_without_labels_opens_as_its_lid_does(tmp_path: Path) -> None:
    # Seen from one eye alone, its detected corners lie to the side: the gaze makes up for it.
    recording = Recording(
        face="alder@11", width_px=1440, fps=120, seconds=0.7, onsets=(0.1,), noise=2, crf=18, gaze_mm=-1
    )
    video = recording.write_close_up(tmp_path / "eye.mp4")
    baked = bake_recording(RecordingOrder(video, tmp_path / "made", one_eye=True))
    recorded = [k for k, level in enumerate(baked.levels) if level.first == level.second]
    off = baked.measured.closures[recorded] - recording.closure[baked.frames.numbers]
    opening_mm = find_character(recording.face).geometry.opening_mm
    # With the motion of the skin alone, lids that were 1 mm apart were taken to touch.
    assert np.abs(off).max() * opening_mm <= 0.25
    assert baked.opening_mm == pytest.approx(opening_mm, abs=0.3)


WIDTH_PX = 300.0
LOWER = 0.2


def profiles(upper: NDArray[np.float64], eye: float) -> NDArray[np.float64]:
    """Columns of an eye under skin whose upper margin is at `upper`, in eye widths; the lower at `LOWER`."""
    lid, lashes, cheek = (
        1 / (1 + np.exp(away / 0.004))
        for away in (EDGE_ROWS - upper[:, None], EDGE_ROWS - upper[:, None] - 0.02, LOWER - EDGE_ROWS)
    )
    # The upper lid's lashes hang before the lower lid.
    return eye + (150 - eye) * np.maximum(lid, cheek * (1 - lashes))


def test_margins_are_seen_although_the_motion_drifts() -> None:
    upper = np.linspace(-0.12, 0.18, 31)
    # The skin is followed 2% of the eye's width too far on its way.
    travel = (upper.max() - upper) * 1.07 * WIDTH_PX
    margins = seen_margins(profiles(upper, 30.0), travel, WIDTH_PX)
    assert margins is not None
    assert margins.lower == pytest.approx(LOWER * WIDTH_PX, abs=0.5)
    # Of the error of 6 px half is left.
    assert np.abs(margins.upper - upper * WIDTH_PX)[:-3].max() <= 3.2


def test_a_pressed_lid_is_shut_before_it_is_lowest() -> None:
    # The last frames go 1.2 mm over the lower lid, and the skin is not followed there.
    upper = np.concatenate([np.linspace(-0.12, LOWER, 33), LOWER + np.array([0.01, 0.025, 0.035, 0.04])])
    travel = np.maximum(LOWER - upper, 0) * WIDTH_PX
    px_per_mm = WIDTH_PX / 30
    opening = lid_opening(travel, seen_margins(profiles(upper, 30.0), travel, WIDTH_PX), px_per_mm)
    assert (opening[-3:] == 0).all()
    # By the lowest place alone it would be 0.95 mm.
    assert 0 < opening[32] < 0.6 * px_per_mm
    assert opening[0] / px_per_mm == pytest.approx(0.32 * 30, abs=0.5)


def test_an_eye_as_bright_as_skin_shows_no_margins() -> None:
    upper = np.linspace(-0.12, 0.18, 31)
    travel = (upper.max() - upper) * WIDTH_PX
    assert seen_margins(profiles(upper, 130.0), travel, WIDTH_PX) is None
    # The motion alone is left.
    opening = lid_opening(travel, None, WIDTH_PX / 30)
    assert opening[0] == pytest.approx(travel[0] - 2.5, abs=0.1)
    assert opening[-1] == 0


def test_eyes_that_do_not_open_are_refused() -> None:
    noise = np.random.default_rng(0).random((240, 320)).astype(np.float32)
    picture = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 3), None, 0, 255, cv2.NORM_MINMAX)  # type: ignore[call-overload]
    pictures = [np.roll(picture.astype(np.uint8), -3 * number, 0) for number in range(5)]
    lids = [(130, 105), (160, 100), (190, 105), (130, 132), (160, 138), (190, 132)]
    points = np.array([(100, 120), *lids[:4], (220, 120), *lids[4:], (160, 120)], dtype=float)
    with pytest.raises(InputError, match="motion of the lids cannot be followed"):
        lid_travel(pictures, points, points, 4)


EXPERIMENT = """
name = "recorded"
title = "A recorded character"

[[factors]]
name = "profile"
label = "Profile"
[[factors.levels]]
name = "real"
label = "Real"
render = { profile = "real" }
[[factors.levels]]
name = "model"
label = "Model"
render = { profile = "model" }

[exemplars]
per_cell = 1
own_per = ["profile"]

[render]
character = "made"
width_px = 960
height_px = 360

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


def test_the_painter_renders_it_and_verify_agrees(made: Made) -> None:
    from experiments.load import load_experiment

    file = made.folder.parent / "recorded.toml"
    file.write_text(EXPERIMENT, encoding="utf-8")
    out = made.folder.parent / "clips"
    build(load_experiment(str(file)), out, Options(base_folder=file.parent), Machines(workers=1))
    verdict = verify(out, file.parent)
    assert verdict.findings == ()
    assert verdict.opening_checked == 2


def test_the_report_says_what_is_interpolated(made: Made) -> None:
    page = (made.folder / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/webp;base64,") == 4
    assert "http" not in page
    assert page.count("interpolated, frames") >= 3
    assert "Nothing: no limit was found." in page


# Bad input: rejected in one line, or made with its limits.


def refusal(recording: Recording, folder: Path, **options: object) -> str:
    video, track = recording.write(folder)
    order = replace(RecordingOrder(video, folder / "made", track), **options)  # type: ignore[arg-type]
    with pytest.raises(InputError) as caught:
        bake_recording(order)
    assert not (folder / "made" / "character.toml").exists()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_eyes_that_never_close_are_refused(tmp_path: Path) -> None:
    assert "no eye closes fully, the deepest closure is 0.6" in refusal(replace(SMALL, depth=0.6), tmp_path)


def test_a_person_who_looks_away_is_refused(tmp_path: Path) -> None:
    assert "look to the side" in refusal(replace(SMALL, gaze_mm=5.0), tmp_path)


def test_the_track_of_another_video_is_refused(tmp_path: Path) -> None:
    video, _ = SMALL.write(tmp_path)
    shorter = replace(SMALL, seconds=0.9).write_track(tmp_path / "shorter.csv")
    later = replace(SMALL, onsets=(0.55,)).write_track(tmp_path / "later.csv")
    larger = replace(SMALL, width_px=1920).write_track(tmp_path / "larger.csv")
    for track, words in (
        (shorter, "216 frames, but person.mp4 has 240"),
        (later, "do not agree with the pictures"),
        (larger, "outside the picture"),
    ):
        with pytest.raises(InputError, match=words):
            bake_recording(RecordingOrder(video, tmp_path / "made", track))


def test_one_eye_and_two_eyes_are_not_confused(tmp_path: Path) -> None:
    assert "track of 2 eyes; remove --one-eye" in refusal(SMALL, tmp_path, one_eye=True)


def test_a_blink_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    assert "it is cut off" in refusal(replace(SMALL, seconds=0.45), tmp_path)


def test_a_folder_that_holds_a_character_is_kept(tmp_path: Path) -> None:
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "character.toml").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="there is a character already"):
        bake_recording(RecordingOrder(tmp_path / "person.mp4", tmp_path / "made"))
    assert (tmp_path / "made" / "character.toml").read_text(encoding="utf-8") == "mine"


def test_one_blink_is_stated(tmp_path: Path) -> None:
    limits = " ".join(bake(SMALL, tmp_path).limits)
    assert "Only one blink" in limits
    assert "pixels wide" in limits
    assert not any(words in limits for words in ("head moved", "light changed", "reflection"))


def test_25_frames_per_second_are_stated(tmp_path: Path) -> None:
    baked = bake(replace(SMALL, fps=25.0, seconds=2.0, onsets=(0.3, 1.1)), tmp_path)
    limits = " ".join(baked.limits)
    assert "At 25 frames per second" in limits
    assert "No frame was recorded between closures" in limits


def test_a_moving_head_is_stated(tmp_path: Path) -> None:
    slow = replace(SMALL, head_px=lambda time_s: 30 * np.sin(2 * np.pi * 0.8 * time_s))
    baked = bake(slow, tmp_path)
    assert "The head moved by" in " ".join(baked.limits)
    assert baked.left_out[1:-1].min() >= 38


def test_rolling_shutter_is_stated(tmp_path: Path) -> None:
    shaken = replace(SMALL, head_px=lambda time_s: 8 * np.sin(2 * np.pi * 4 * time_s), readout_s=0.03)
    assert "rolling shutter" in " ".join(bake(shaken, tmp_path).limits)


def test_changing_light_is_stated(tmp_path: Path) -> None:
    baked = bake(replace(SMALL, light=0.3), tmp_path)
    assert "The light changed by" in " ".join(baked.limits)
    assert baked.left_out[1:-1].min() >= 38


def test_glasses_are_stated(tmp_path: Path) -> None:
    assert "as on glasses" in " ".join(bake(replace(SMALL, glasses=True), tmp_path).limits)


# Real eyes, and the command.


def test_real_close_up_of_one_eye(shared_data: Path, tmp_path: Path) -> None:
    folder = shared_data / "face_video"
    video, track = folder / "short_human_3blink.mp4", tmp_path / "track.csv"
    labels = folder / "short_human_3blink.points.json"
    run_track(TrackJob(video, track, TrainingOptions(), labels=labels, one_eye=True))
    baked = bake_recording(RecordingOrder(video, tmp_path / "made", track, one_eye=True))
    near = near_both_sides(baked.frames.closures)
    assert near.sum() >= 8
    assert baked.left_out[near].min() >= 38
    assert np.nanmedian(baked.left_out) >= 38
    assert len(load_atlas(tmp_path / "made").closures) >= 17
    assert np.abs(baked.measured.off_mm).max() <= 0.2
    assert any("78 frames per second" in limit for limit in baked.limits)


def test_without_a_track_the_command_tracks_first(
    shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    video = shared_data / "face_video" / "short_human_3blink.mp4"
    out = tmp_path / "made"
    monkeypatch.setattr(
        "sys.argv", ["stimuli", "bake", "recording", str(video), "--one-eye", "--out", str(out)]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert "left-out frames: median" in said
    assert "opening up to 0.4 mm off, as measured without labels" in said
    assert "limit: Openings were measured without labels" in said
    assert (out / "track.csv").is_file()
    assert (out / "report.html").is_file()
    # Between labeled lids the iris is 194 px wide: 16.6 px per mm. Between the detector's,
    # it was taken for 143 px in the open frame.
    declared = load_atlas(out).declaration
    assert declared.px_per_mm == pytest.approx(16.6, rel=0.03)
    # Edges seen below the pupil of the open frame are 9.74 mm apart; labels of other frames say 9.3 to 10.
    assert declared.opening_mm == pytest.approx(9.74, abs=0.3)
