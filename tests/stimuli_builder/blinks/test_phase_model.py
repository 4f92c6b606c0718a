"""Blinks drawn phase by phase close as the recorded ones do; each recorded moment is left out in turn."""

import numpy as np
import pytest
from scipy.stats import ks_2samp

from experiments.errors import InputError
from stimuli_builder.blinks.blink_model import PhaseModel
from stimuli_builder.blinks.library import load_library


def facts(profile):
    """Peak closure, duration and peak closing speed."""
    return profile.closure.max(), profile.duration_ms, np.diff(profile.closure).max() * profile.fps


def recorded():
    return [profile for profile in load_library() if profile.closure_other is None]


def moment(profile):
    """Both eyes' profiles of one blink share it."""
    return profile.recording, profile.profile_id.rsplit("-", 1)[1]


@pytest.fixture(scope="module")
def drawn():
    """Blinks of models that each have not seen one moment, both eyes."""
    profiles, made = recorded(), []
    for left_out in sorted({moment(profile) for profile in profiles}):
        model = PhaseModel.fit([profile for profile in profiles if moment(profile) != left_out])
        for seed in range(40):
            rng = np.random.default_rng([seed, len(made)])
            made.append(model.sample(None, rng, profile_id=f"{len(made)}"))
    return made


@pytest.mark.parametrize("fact", range(3), ids=["peak closure", "duration", "peak speed"])
def test_peak_duration_and_speed_are_spread_as_recorded(drawn, fact):
    true = np.array([facts(profile)[fact] for profile in recorded()])
    made = np.array([facts(profile)[fact] for profile in drawn])
    critical = 1.358 * np.sqrt((true.size + made.size) / (true.size * made.size))
    assert ks_2samp(true, made).statistic < critical


def test_no_blink_turns_in_a_cusp(drawn):
    def turn(profile):
        steps, lowest = np.diff(profile.closure), profile.minimum_index
        return (steps[lowest - 1] - steps[lowest]) / steps.max()

    assert np.median([turn(p) for p in drawn]) <= np.median([turn(p) for p in recorded()]) + 0.02


def test_the_closed_phase_is_kept(drawn):
    def closed_ms(profile):
        return (profile.closure >= 0.97 * profile.closure.max()).sum() * 1000 / profile.fps

    true, made = (np.median([closed_ms(p) for p in part]) for part in (recorded(), drawn))
    assert made == pytest.approx(true, rel=0.35)


def test_a_wanted_duration_is_met_and_a_seed_repeats():
    model = PhaseModel.fit(recorded())
    one, two = (model.sample(9, np.random.default_rng(3), profile_id="a") for _ in range(2))
    assert one.duration_frames_30fps == 9
    assert (one.closure == two.closure).all()


def test_two_profiles_are_too_few():
    with pytest.raises(InputError, match="needs 3 profiles"):
        PhaseModel.fit(recorded()[:2])
