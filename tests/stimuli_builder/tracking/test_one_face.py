"""Which of several faces is tracked."""

import numpy as np

from stimuli_builder.tracking.detector.detection import Detection
from stimuli_builder.tracking.detector.one_face import one_face


def at(x, side):
    """A face of that side about (x, 100)."""
    box = np.array([x - side / 2, 100 - side / 2, x + side / 2, 100 + side / 2])
    return Detection(np.zeros((18, 2)), np.zeros((2, 5, 2)), box)


def middles(chosen):
    return [float(face.box[[0, 2]].mean()) for face in chosen.values()]


def test_the_face_larger_over_the_recording_is_taken_where_another_is_larger_for_a_while():
    seen = {n: [at(100 + n, 80), at(400, 90 if 4 <= n < 7 else 60)] for n in range(0, 12)}
    assert middles(one_face(seen)) == [100 + n for n in range(12)]


def test_another_face_does_not_stand_in_where_the_one_tracked_is_not_seen():
    seen = {n: [at(400, 60)] if n in {3, 4} else [at(100, 80), at(400, 60)] for n in range(10)}
    chosen = one_face(seen)
    assert sorted(chosen) == [0, 1, 2, 5, 6, 7, 8, 9]
    assert set(middles(chosen)) == {100.0}


def test_a_lone_face_is_taken_on_both_sides_of_a_cut_and_of_a_gap():
    seen = {n: [at(100, 80)] for n in range(5)} | {5: [], 6: []} | {n: [at(400, 50)] for n in range(7, 9)}
    assert middles(one_face(seen)) == [100.0] * 5 + [400.0] * 2


def test_no_face_is_none():
    assert one_face({0: [], 1: []}) == {}
