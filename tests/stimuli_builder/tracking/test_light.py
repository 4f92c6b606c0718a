"""A recording whose light changes is tracked as one in even light; a covered eye is lost in any light."""

from dataclasses import replace

import numpy as np
import pytest

from stimuli_builder.tracking.fit import Fitter
from stimuli_builder.tracking.shapes import widths
from stimuli_builder.tracking.stillness import Light, light_between
from stimuli_builder.tracking.tracker import Tracker

EYE_PX = 60


def in_light(picture, gain, offset):
    return np.clip(np.rint(gain * picture.astype(np.float32) + offset), 0, 255).astype(np.uint8)


CHANGES = {
    "a slow fade to 60%": lambda n: (1 - 0.4 * n / 200, 0.0),
    "clouds": lambda n: (1 + 0.25 * np.sin(n / 15), 0.0),
    "a lamp switched off": lambda n: (0.7 if n >= 100 else 1.0, 0.0),
    "a lamp on the mains": lambda n: (1 + 0.06 * np.sin(2.1 * n), 0.0),
    "another range of luminance": lambda n: (219 / 255, 16.0),
    "less contrast": lambda n: (0.7, 40.0),
}


@pytest.mark.parametrize("what", CHANGES)
def test_changing_light_is_followed(lesson, recording, what):
    tracker, far, given = Tracker(lesson.model), [], 0
    for number, (picture, true) in enumerate(zip(recording.pictures, recording.points, strict=True)):
        frame = tracker.step(in_light(picture, *CHANGES[what](number)))
        if frame.points is not None:
            given += 1
            far.append(np.hypot(*(frame.points - true).T).mean())
    assert given >= 0.85 * len(recording.pictures)
    assert max(far) < 0.02 * EYE_PX


def test_even_light_changes_no_number(lesson, recording, monkeypatch):
    tracker = Tracker(lesson.model)
    with_light = [tracker.step(picture).points for picture in recording.pictures[:60]]
    monkeypatch.setattr(Light, "following", lambda self, *_: self)
    tracker = Tracker(lesson.model)
    without = [tracker.step(picture).points for picture in recording.pictures[:60]]
    assert np.array_equal(np.array(with_light), np.array(without))


def test_a_covered_eye_is_lost_in_other_light_too(lesson, recording):
    tracker, statuses = Tracker(lesson.model), []
    for number, picture in enumerate(recording.pictures[:60]):
        dim = in_light(picture, 0.75 if number >= 10 else 1.0, 0.0)
        if number >= 40:
            left, top = recording.points[number][:9].min(0).astype(int) - 6
            right, low = recording.points[number][:9].max(0).astype(int) + 6
            dim[top:low, left:right] = 110
        statuses.append(tracker.step(dim).status)
    assert "lost" not in statuses[:40]
    assert set(statuses[40:]) <= {"lost", "doubtful"}


def test_eyes_lost_in_a_light_followed_wrongly_are_found_in_that_of_the_labels(lesson, recording):
    tracker = Tracker(lesson.model)
    tracker.step(recording.pictures[0])
    tracker.step(np.zeros_like(recording.pictures[0]))
    tracker._light = Light(1.7, -30.0)  # as a bad frame may have left it
    assert tracker.step(recording.pictures[2]).status == "reinitialised"


@pytest.mark.parametrize(("gain", "offset"), [(0.6, 0.0), (1.4, -20.0), (0.8, 30.0)])
def test_gain_and_offset_are_found_despite_what_no_model_explains(gain, offset):
    rng = np.random.default_rng(2)
    look = rng.uniform(40, 200, 6500).astype(np.float32)
    seen = ((look - offset) / gain + rng.normal(0, 20, 6500)).astype(np.float32)
    told = light_between(look, seen, np.ones(6500, np.float32))
    assert told == pytest.approx((gain, offset), abs=1.5)
    assert told[0] == pytest.approx(gain, rel=0.02)


def test_a_fit_that_broke_down_shows_no_light(lesson, recording):
    fitter, model = Fitter(lesson.model), lesson.model
    dim = in_light(recording.pictures[0], 0.6, 0.0)
    seen = fitter.fit(dim, np.zeros(len(model.sd)), model.poses[0], 1)
    assert not Light(*seen.light).steady  # what the buffers hold
    broken = fitter.fit(dim, np.zeros(len(model.sd)), np.full(4, np.nan))
    assert (broken.iterations, broken.light) == (0, (1.0, 0.0))


def test_nothing_in_common_shows_no_light():
    look = np.linspace(40, 200, 500, dtype=np.float32)
    gain, offset = light_between(look, look[::-1].copy(), np.ones(500, np.float32))
    assert not Light(gain, offset).believable
    assert Light().following(gain, offset) == Light()


def test_light_goes_back_where_nothing_is_reported():
    light = Light(1.3, -20.0)
    for _ in range(400):
        light = light.following(1.0, 0.0)
    assert light.steady


@pytest.mark.parametrize("stale", [Light(1.15, 3.4), Light(0.8, 0.0)])
def test_a_light_that_is_over_is_left_although_doubtful_frames_are_not_followed(lesson, recording, stale):
    """A shadow of a fifth of a second made the 280 frames after it of a rendered close-up doubtful."""
    model = lesson.model
    coarse = replace(
        model,
        point_errors=np.full_like(model.point_errors, 0.03 * widths(recording.points[0])),
        error_slope=np.array([1.0]),
        residual_limits=10 * model.residual_limits,
    )
    tracker = Tracker(coarse)
    for picture in recording.pictures[:8]:
        tracker.step(picture)
    tracker._light = stale  # as a shadow may have left it
    assert [tracker.step(picture).status for picture in recording.pictures[8:28]] == ["tracked"] * 20
