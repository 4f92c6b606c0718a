"""Keys are the engine's curve and nothing else; a blink is found again among keys."""

import numpy as np
import pytest
from blender_addon.lid_keys import Passage, blink_at, flag_holds, lid_keys, one_blink, passage

from blink_engine import Hold


@pytest.mark.parametrize("fps", [24.0, 23.976, 60.0, 120.0])
def test_every_frame_is_the_curve(fps: float) -> None:
    done = passage(Passage(1, 3000, fps, seed=7, state="speaking"))
    keys = lid_keys(done.left, 1)
    frames = np.arange(1, done.left.size + 1)
    assert np.interp(frames, keys.frames, keys.values) == pytest.approx(done.left, abs=1e-6)


def test_eyes_stay_open_while_the_flag_is_up() -> None:
    up = np.zeros(600, bool)
    up[:50] = up[200:400] = up[590:] = True
    holds = flag_holds(up, 25.0)
    assert holds == (Hold(0.0, 2.0), Hold(8.0, 16.0), Hold(23.6, 24.0))
    assert flag_holds(np.zeros(5, bool), 25.0) == ()
    done = passage(Passage(1, 600, 25.0, seed=7, state="speaking", holds=holds))
    assert (done.left[up] == 0).all()
    assert done.left[~up].max() > 0.5


def test_few_keys_keep_onset_peak_and_end() -> None:
    closure = np.array([0, 0, 0.3, 1, 1, 1, 0.6, 0.2, 0, 0])
    keys = lid_keys(closure, 10, "FEW")
    assert keys.frames.tolist() == [11, 13, 15, 18]
    assert keys.values.tolist() == [0, 1, 1, 0]


def test_one_blink_is_one_and_ends_open() -> None:
    for seed in range(50):
        done = one_blink(30.0, seed)
        assert len(done.blinks) == 1 or done.blinks[0].cause == "blink"
        assert done.left[-1] == 0.0
        assert done.left.max() > 0.1


def test_a_blink_is_found_among_keys() -> None:
    frames = np.array([3, 4, 5, 6, 20, 21, 22], float)
    assert blink_at(frames, 5) == (3, 6)
    assert blink_at(frames, 21) == (20, 22)
    assert blink_at(frames, 10) is None
    assert blink_at(np.empty(0), 10) is None


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        (Passage(10, 10, 24, 1, "rest"), "an end after the start"),
        (Passage(1, 100, 0.5, 1, "rest"), "1 to 1000 frames"),
        (Passage(1, 100, 24, 1, "rest", 99), "0.1 to 60 per minute"),
    ],
)
def test_what_cannot_be_filled_is_refused(asked: Passage, line: str) -> None:
    with pytest.raises(ValueError, match=line):
        passage(asked)
