"""Which blink an exemplar shows."""

from pathlib import Path

import numpy as np
import pytest

from experiments import design
from experiments.declaration.rendering import RenderSettings
from experiments.errors import InputError
from experiments.load import load_experiment
from stimuli_builder.blinks.library import load_library
from stimuli_builder.clips.exemplars import exemplar, recorded_order

ALL = ("real", "model", "SL", "AL", "SL_ease", "AL_ease")


def settings_for(profile: str, **more: object) -> RenderSettings:
    return RenderSettings.model_validate({"profile": profile} | more)


def test_every_recording_is_used_before_any_is_used_twice() -> None:
    count = len(load_library())
    order = recorded_order(count + 2, 2011, "real")
    assert len({profile.profile_id for profile, _ in order[:count]}) == count
    assert [repeated for _, repeated in order] == [False] * count + [True] * 2


@pytest.mark.parametrize("profile", ALL)
def test_the_same_key_gives_the_same_blink_in_every_cell(profile: str) -> None:
    first = exemplar(settings_for(profile, character="cartoon"), "key", 3, 5)
    again = exemplar(settings_for(profile, motion_blur=False), "key", 3, 5)
    np.testing.assert_array_equal(first.profile.closure, again.profile.closure)
    assert first.phase_samples == again.phase_samples


@pytest.mark.parametrize("profile", ALL)
def test_full_closure_shuts_the_eye(profile: str) -> None:
    for number in range(1, 6):
        assert exemplar(settings_for(profile), "key", number, 5).profile.closure.max() == 1.0


@pytest.mark.parametrize("profile", ["real", "model"])
def test_natural_closure_keeps_what_was_measured(profile: str) -> None:
    natural = [exemplar(settings_for(profile, amplitude="natural"), "k", n, 5) for n in range(1, 9)]
    assert any(shown.profile.closure.max() < 0.95 for shown in natural)


@pytest.mark.parametrize("profile", ["SL", "AL", "SL_ease", "AL_ease"])
@pytest.mark.parametrize("duration", [7, 9, 11, 13])
def test_textbook_exemplars_differ_and_keep_their_length(profile: str, duration: int) -> None:
    shown = [exemplar(settings_for(profile, duration_frames=duration), "k", n, 5) for n in range(1, 6)]
    assert len({one.phase_samples for one in shown}) == 5
    assert all(one.profile.duration_frames_30fps == pytest.approx(duration) for one in shown)


def test_recorded_and_modelled_blinks_take_a_wanted_length() -> None:
    for profile in ("real", "model"):
        shown = exemplar(settings_for(profile, duration_frames=9), "k", 1, 5).profile
        assert shown.duration_frames_30fps == pytest.approx(9)


@pytest.mark.parametrize("fps", [24, 25, 30, 50, 60])
def test_blinks_begin_anywhere_within_one_frame_at_every_rate(fps: int) -> None:
    step = 300 / fps
    phases = [exemplar(settings_for("SL", fps=fps), "key", n, 5).phase_samples for n in range(1, 41)]
    assert max(phases) < step
    assert sorted(set(phases)) == list(range(int(step)))


@pytest.mark.parametrize("fps", [24, 25, 50, 60])
@pytest.mark.parametrize("profile", ["real", "AL_ease"])
def test_a_blink_lasts_as_declared_at_every_rate(profile: str, fps: int) -> None:
    def length_ms(**declared: float) -> float:
        return exemplar(settings_for(profile, fps=fps, **declared), "k", 1, 5).profile.duration_ms

    assert length_ms(duration_frames=9) == pytest.approx(300)
    assert length_ms(duration_frames=15, duration_frames_fps=50) == pytest.approx(300)
    assert length_ms(duration_ms=300) == pytest.approx(300)


def test_eyes_apart_come_from_blinks_seen_in_both() -> None:
    for profile in ("real", "model"):
        shown = exemplar(settings_for(profile, eyes="separate"), "k", 1, 5).profile
        assert shown.closure_other is not None
        assert shown.closure_other.max() == 1.0
    assert exemplar(settings_for("real"), "k", 1, 5).profile.closure_other is None


def test_eyes_apart_need_both_eyes_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("closure\n0\n1\n0\n")
    with pytest.raises(InputError, match="closure_other"):
        exemplar(settings_for("one.csv", eyes="separate"), "k", 1, 5, tmp_path)


def test_exp3_shows_one_blink_in_all_lower_lid_cells() -> None:
    experiment = load_experiment("exp3")
    keys = {design.exemplar_key(experiment, spec) for spec in design.clips(experiment) if spec.exemplar == 7}
    assert len(keys) == 1
