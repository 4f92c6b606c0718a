import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.blinks.blink_model import BlinkModel, default_model
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import phase_spline


def test_a_model_with_all_components_rebuilds_its_blinks():
    training = load_library()
    model = BlinkModel.fit(training, len(training) - 1)
    assert model.variance_kept == pytest.approx(1.0)
    for blink in training:
        form, down, up = model.normalised_forms(model.coefficients(blink))
        assert down * model.down_frames == pytest.approx(blink.down_frames, abs=1e-6)
        assert up * model.up_frames == pytest.approx(blink.up_frames, abs=1e-6)
        expected = phase_spline(blink.closure[: blink.minimum_index + 1], model.down_frames)
        assert form[0, : model.down_frames + 1] == pytest.approx(expected, abs=1e-6)


def test_components_are_orthonormal_and_ordered():
    model = default_model()
    assert model.components @ model.components.T == pytest.approx(np.eye(5), abs=1e-6)
    assert (np.diff(model.explained) <= 0).all()


def test_five_components_keep_98_percent():
    assert default_model().variance_kept >= 0.98


def test_the_shipped_model_is_the_one_fitted_to_the_shipped_profiles():
    fitted, shipped = BlinkModel.fit(load_library()), default_model()
    assert shipped.trained_on == fitted.trained_on
    assert shipped.coefficient_sd == pytest.approx(fitted.coefficient_sd, abs=1e-5)
    assert np.abs(shipped.components) == pytest.approx(np.abs(fitted.components), abs=1e-4)


def test_both_blocks_of_columns_carry_the_same_variance():
    training = load_library()
    model = BlinkModel.fit(training, len(training) - 1)
    loads = model.components * model.coefficient_sd[:, None]
    assert (loads[:, -2:] ** 2).sum() == pytest.approx((loads[:, :-2] ** 2).sum(), rel=1e-6)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_new_blinks_never_have_a_negative_distance(seed):
    blink = default_model().sample(rng=np.random.default_rng(seed))
    assert blink.closure.max() <= 1.0
    assert blink.closure[blink.minimum_index] == blink.closure.max()
    assert 3 < blink.duration_frames_30fps < 20


@settings(deadline=None, max_examples=20)
@given(st.sampled_from([7, 9, 11, 13]), st.integers(0, 1000))
def test_a_wanted_duration_is_met(duration, seed):
    blink = default_model().sample(duration, np.random.default_rng(seed))
    assert blink.duration_frames_30fps == duration


def test_the_same_seed_gives_the_same_blink():
    first, second = (default_model().sample(rng=np.random.default_rng(7)) for _ in range(2))
    assert first.profile_id == second.profile_id
    assert (first.closure == second.closure).all()


def test_coefficients_beyond_closure_are_dropped():
    model = default_model()
    deep = np.zeros(5)
    deep[0] = 40 * np.sign(model.components[0, model.down_frames]) * model.coefficient_sd[0]
    assert model.profile(deep, "deep") is None


def test_a_model_of_both_eyes_keeps_their_asymmetry():
    pairs = load_library(paired=True)
    model = BlinkModel.fit(pairs)
    made = [model.sample(rng=np.random.default_rng(seed)) for seed in range(30)]
    recorded = np.mean([p.closure.max() - p.closure_other.max() for p in pairs])
    sampled = np.mean([p.closure.max() - p.closure_other.max() for p in made])
    assert all(blink.eye == "both" for blink in made)
    assert sampled == pytest.approx(recorded, abs=0.1)


def test_saving_and_loading_is_the_identity(tmp_path):
    model = BlinkModel.fit(load_library(paired=True), 4)
    model.save(tmp_path / "m.json")
    again = BlinkModel.load(tmp_path / "m.json")
    assert (again.eyes, again.down_frames, again.up_frames) == (2, model.down_frames, model.up_frames)
    assert again.components == pytest.approx(model.components, abs=1e-8)
    assert again.trained_on == model.trained_on


@pytest.mark.parametrize("components", [0, 21, 40])
def test_an_impossible_number_of_components_is_refused(components):
    with pytest.raises(InputError, match="allow 1 to 20"):
        BlinkModel.fit(load_library(), components)


def test_too_few_profiles_are_refused():
    with pytest.raises(InputError, match="3 profiles or more"):
        BlinkModel.fit(load_library()[:2])


def test_a_one_eyed_profile_does_not_fit_a_model_of_both():
    with pytest.raises(InputError, match="needs both"):
        BlinkModel.fit(load_library(paired=True)).coefficients(load_library()[0])


@pytest.mark.parametrize("content", ["{}", "no json", '{"format": "other"}', "[1]"])
def test_a_file_that_is_not_a_model_is_refused(tmp_path, content):
    (tmp_path / "m.json").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"m\.json"):
        BlinkModel.load(tmp_path / "m.json")


def test_a_missing_model_is_refused(tmp_path):
    with pytest.raises(InputError, match="stimuli model fit"):
        BlinkModel.load(tmp_path / "none.json")
