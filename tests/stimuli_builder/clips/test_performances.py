"""Clips of whole performances: what times their blinks, how alike they look, and what they keep in memory."""

from pathlib import Path
from typing import get_args

import av
import numpy as np
import pytest

from blink_engine import STATE_NAMES
from blink_engine.parameters import EVENT_KINDS
from experiments.declaration.rendering import EventKind, RenderOverrides, RenderSettings, State
from experiments.errors import InputError
from experiments.load import load_experiment, parse_experiment
from experiments.manifest import read_manifest
from stimuli_builder.clips.build import Machines, build
from stimuli_builder.clips.characters import kept_levels
from stimuli_builder.clips.design_clips import TIMER_SHARES, Options, performance_curve, planned_clips
from stimuli_builder.clips.frames import PAINTED_KEPT, FramePainter
from stimuli_builder.clips.verify import verify

from .conftest import SMALL, make_small

SHIPPED = Path(__file__).resolve().parents[3] / "experiments"
PERFORMED = (
    SMALL.replace('render = { profile = "real" }', 'render = { performance = "intervals" }')
    .replace('render = { profile = "mine.csv", duration_frames = 8 }', 'render = { performance = "none" }')
    .replace("[render]", "[render]\nseconds = 3.0\nblinks_per_minute = 50.0")
)


def settings_of(timing: str, **further: object) -> RenderSettings:
    return RenderSettings.model_validate({"performance": timing, "amplitude": "natural", **further})


def test_the_declared_names_are_the_engines() -> None:
    assert get_args(State) == STATE_NAMES
    assert set(get_args(EventKind)) <= set(EVENT_KINDS)


def test_fitted_intervals_are_the_engines_own_stream() -> None:
    curve = performance_curve(settings_of("intervals", seconds=60, eyes="separate"), "", 1, 7)
    assert len(curve.closure) == 18_000
    assert curve.closure_other is not None
    # Any seed gives blinks that the engine draws; this one's onsets are where the curve leaves 0.
    for onset_s in curve.blinks_s:
        at = int(np.ceil((onset_s + 0.03) * 300))
        assert curve.closure[at] > 0 or curve.closure_other[at] > 0
    again = performance_curve(settings_of("intervals", seconds=60, eyes="separate"), "", 1, 7)
    np.testing.assert_array_equal(again.closure, curve.closure)


def test_a_timer_waits_evenly_between_half_and_one_and_a_half_means() -> None:
    waits = np.concatenate(
        [
            np.diff(performance_curve(settings_of("uniform", seconds=60), "", number, 7).blinks_s)
            for number in range(1, 41)
        ]
    )
    mean_s = 60 / 17
    low, high = (share * mean_s for share in TIMER_SHARES)
    assert waits.min() >= low - 1e-3
    assert waits.max() <= high + 1e-3
    # Of 40 minutes; longer waits are cut off by the clips' ends a little more often than shorter ones.
    assert waits.mean() == pytest.approx(mean_s, rel=0.05)
    assert waits.std() == pytest.approx((high - low) / np.sqrt(12), rel=0.1)


def test_blinks_look_alike_whatever_times_them() -> None:
    timer = performance_curve(settings_of("uniform", seconds=30), "", 3, 7)
    fitted = performance_curve(settings_of("intervals", seconds=30), "", 3, 7)
    peaks = [
        [curve.closure[int(at * 300) : int(at * 300) + 120].max() for at in curve.blinks_s[:3]]
        for curve in (timer, fitted)
    ]
    assert peaks[0][0] == pytest.approx(peaks[1][0], abs=0.02)


def test_events_draw_blinks_to_them() -> None:
    events = (5.0, 15.0, 25.0)

    def near(timing: str) -> float:
        own = {"events_s": events} if timing == "events" else {}
        onsets = [
            performance_curve(settings_of(timing, seconds=30, **own), "", number, 7).blinks_s
            for number in range(1, 61)
        ]
        hits = [any(0 <= one - event <= 0.375 for one in each) for each in onsets for event in events]
        return float(np.mean(hits))

    # Seven of ten turn ends are answered; 0.375 s hold a blink by chance in about one of ten.
    assert near("events") > 0.6
    assert near("intervals") < 0.25


def test_full_closes_every_blink_and_none_keeps_the_eyes_open() -> None:
    full = performance_curve(settings_of("intervals", amplitude="full"), "", 2, 7)
    tops = [full.closure[int(at * 300) : int(at * 300) + 150].max() for at in full.blinks_s[:-1]]
    assert tops
    assert min(tops) > 0.99
    still = performance_curve(settings_of("none"), "", 2, 7)
    assert not still.closure.any()
    assert still.blinks_s == ()


def test_speech_next_to_the_toml_is_answered(tmp_path: Path) -> None:
    (tmp_path / "talk.vtt").write_text(
        "WEBVTT\n\n00:00.500 --> 00:04.000\nOne.\n\n00:06.500 --> 00:12.000\nTwo.\n"
    )
    chosen = settings_of("events", speech="talk.vtt", seconds=10)
    assert performance_curve(chosen, "", 1, 7, tmp_path).blinks_s
    with pytest.raises(InputError, match=r"talk\.vtt lasts 12\.0 s, but the clip lasts 20 s"):
        performance_curve(settings_of("events", speech="talk.vtt"), "", 1, 7, tmp_path)
    with pytest.raises(InputError, match="no such file"):
        performance_curve(settings_of("events", speech="other.vtt"), "", 1, 7, tmp_path)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"performance": "events"}, "expected events_s or speech, got neither"),
        ({"performance": "events", "events_s": (3.0, 25.0)}, "expected moments within the 20 s, got 25"),
        ({"performance": "now and then"}, "'uniform', 'intervals', 'events' or 'none'"),
        ({"performance": "none", "seconds": 61}, "less than or equal to 60"),
    ],
)
def test_what_cannot_be_is_refused(wrong: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        RenderSettings.model_validate(wrong)


def test_a_level_changes_the_timing() -> None:
    level = RenderOverrides(performance="uniform", seconds=5.0)
    assert level.applied_to(settings_of("none")).performance == "uniform"


@pytest.fixture(scope="module")
def performed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with clips of 3 s of two characters, with blinks and without."""
    small = make_small(tmp_path_factory.mktemp("performed") / "study", PERFORMED)
    build(small.experiment, small.folder / "clips", small.options, Machines(workers=1))
    return small.folder


def test_clips_are_what_the_manifest_promises(performed: Path) -> None:
    manifest = read_manifest(performed / "clips")
    assert verify(performed / "clips", performed).findings == ()
    for clip in manifest.clips:
        assert (clip.frames, len(clip.closure)) == (90, 900)
        if clip.levels["profile"] == "mine":
            assert (clip.blinks_s, clip.onset_frame, clip.inputs["performance"]) == ((), None, "none")
        elif clip.blinks_s:
            assert clip.onset_frame == int(clip.blinks_s[0] * 300) // 10
    assert any(clip.blinks_s for clip in manifest.clips if clip.levels["profile"] == "real")
    # Open eyes are the same picture throughout, so these clips share one file per character.
    assert len({clip.file for clip in manifest.clips if not clip.blinks_s}) == 2
    assert '"blinks_s"' in (performed / "clips" / "manifest.json").read_text()


def test_each_frame_shows_the_engines_lids(performed: Path) -> None:
    """The eye's opening read from the decoded picture falls where the engine closes, frame by frame."""
    clip = next(clip for clip in read_manifest(performed / "clips").clips if clip.blinks_s)
    with av.open(str(performed / "clips" / clip.file)) as container:
        pictures = [frame.to_ndarray(format="gray").astype(float) for frame in container.decode(video=0)]
    moved = np.array([np.abs(picture - pictures[0]).mean() for picture in pictures])
    shut = np.array(clip.closure).reshape(90, 10).mean(axis=1)
    assert np.corrcoef(moved, shut)[0, 1] > 0.95


def test_a_painter_keeps_few_pictures() -> None:
    planned = planned_clips(load_experiment(str(SHIPPED / "timing.toml")), Options())
    job = next(one.job for one in planned if one.settings.character == "cartoon" and one.job.curve.blinks_s)
    size = (320, 120)
    painter = FramePainter(kept_levels("cartoon", job.look.fingerprint, size, None))
    frames = painter.frames(job.curve, 30, True)
    for _ in range(PAINTED_KEPT * 4):
        next(frames)
    assert len(frames.gi_frame.f_locals["painted"]) <= PAINTED_KEPT  # type: ignore[attr-defined]


def test_the_timing_studies_plan() -> None:
    for name, count in (("timing.toml", 24), ("timing-pairs.toml", 8)):
        experiment = load_experiment(str(SHIPPED / name))
        planned = planned_clips(experiment, Options())
        assert len(planned) == count
        frames = {clip.job.frames for clip in planned}
        assert frames == {round(experiment.render.seconds * 30)}
        blinks = {clip.settings.performance: clip.job.curve.blinks_s for clip in planned}
        assert blinks["none"] == ()
        assert min(len(blinks[timing]) for timing in ("uniform", "intervals", "events")) >= 1


def test_more_frames_than_a_trial_may_log_are_refused() -> None:
    text = (SHIPPED / "timing.toml").read_text().replace("seconds = 20.0", "seconds = 60.0\nfps = 60")
    assert parse_experiment(text.replace("[trial]", "[trial]\nviews = 5", 1)).trial
    with pytest.raises(InputError, match="6 views of 3600 frames exceed the 20000"):
        parse_experiment(text.replace("[trial]", "[trial]\nviews = 6", 1))
