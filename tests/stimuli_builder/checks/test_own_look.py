"""Checks in the study's own look: both answers' clips hold the same pictures, in opposite orders."""

from collections.abc import Callable

import numpy as np
import pytest

from experiments.declaration.rendering import RenderSettings
from stimuli_builder.checks.jobs import OWN_LOOK_QP, first_blink, first_eye
from stimuli_builder.clips.characters import kept_levels
from stimuli_builder.clips.curves import ClipCurve
from stimuli_builder.clips.design_clips import Options, look_of
from stimuli_builder.clips.encode import encode_clip
from stimuli_builder.clips.frames import FramePainter
from tests.stimuli_builder.checks.solvers import decoded

Maker = Callable[[int, float, float, np.random.Generator], ClipCurve]
SECONDS = 1.6


def made(make: Maker, answer: int, seed: int, difficulty: float = 0.5) -> ClipCurve:
    return make(answer, difficulty, SECONDS, np.random.default_rng(seed))


@pytest.mark.parametrize("make", [first_blink, first_eye])
def test_one_answer_is_the_other_in_the_reverse_order(make: Maker) -> None:
    for seed in range(20):
        one, other = made(make, 1, seed), made(make, 2, seed)
        assert (one.closure == other.closure[::-1]).all()
        if one.closure_other is not None:
            assert other.closure_other is not None
            assert (one.closure_other == other.closure_other[::-1]).all()


def test_the_answer_says_which_blink_and_which_eye_came_first() -> None:
    for seed in range(20):
        full_first = made(first_blink, 1, seed).closure
        half = 0.4 + 0.35 * 0.5
        tops = [full_first.argmax(), np.flatnonzero(np.isclose(full_first, half, atol=1e-3)).max()]
        assert tops[0] < tops[1]
        eyes = made(first_eye, 1, seed)
        assert eyes.closure_other is not None
        # The character's right eye is seen at the left.
        assert eyes.closure_other.argmax() < eyes.closure.argmax()


@pytest.mark.parametrize("difficulty", [0.0, 1.0])
@pytest.mark.parametrize("make", [first_blink, first_eye])
def test_every_difficulty_and_the_shortest_clip_can_be_made(make: Maker, difficulty: float) -> None:
    for seed in range(50):
        curve = make(1, difficulty, 1.2, np.random.default_rng(seed))
        assert curve.closure[0] == curve.closure[-1] == 0


def test_decoded_pictures_are_those_of_the_other_answer() -> None:
    """Measured on clips as they are delivered: the bag of pictures is one and the same."""
    look = look_of(RenderSettings(character="cartoon", width_px=320, height_px=120), Options())
    painter = FramePainter(kept_levels(look.character, look.fingerprint, look.size_px, look.beside))
    one, other = (
        decoded(encode_clip(painter.frames(curve, 30, blur=True), look.size_px, 30, alone_qp=OWN_LOOK_QP))
        for curve in (made(first_eye, 1, 11), made(first_eye, 2, 11))
    )
    assert (one == other[::-1]).all()
    assert (one != other).any()
