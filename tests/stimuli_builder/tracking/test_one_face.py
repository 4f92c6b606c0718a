"""Which of several faces is tracked."""

import numpy as np
import pytest

from stimuli_builder.tracking.detector.detection import Detection, one_face
from stimuli_builder.tracking.survey import further_faces


def at(x, side):
    """A face of that side about (x, 100)."""
    box = np.array([x - side / 2, 100 - side / 2, x + side / 2, 100 + side / 2])
    return Detection(np.zeros((18, 2)), np.zeros((2, 5, 2)), box, (0.0, 0.0))


def middles(chosen):
    return [float(face.box[[0, 2]].mean()) for face in chosen.values()]


def sides(chosen):
    return {round(float(face.box[2] - face.box[0]), 6) for face in chosen.values()}


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


@pytest.mark.parametrize("bystander", [60, 150])
def test_a_large_face_that_moves_far_between_looks_wins_whole_over_a_still_smaller_one(bystander):
    there_and_back = {n: [at(300 + 110 * (n % 2), 200), at(900, bystander)] for n in range(100)}
    across = {n: [at(200 + 110 * n, 200), at(4000, bystander)] for n in range(27)}
    rng = np.random.default_rng(1)
    anywhere = {n: [at(rng.uniform(200, 1000), 200), at(1500, bystander)] for n in range(100)}
    for seen in (there_and_back, across, anywhere):
        chosen = one_face(seen)
        assert (sides(chosen), len(chosen)) == ({200.0}, len(seen))


def test_a_large_face_in_pieces_is_whole_where_a_bystander_of_like_size_is_seen_at_times():
    seen = {n: [at(200 + 110 * n, 200)] + ([at(4000, 150)] if n < 20 else []) for n in range(27)}
    chosen = one_face(seen)
    assert (sides(chosen), len(chosen)) == ({200.0}, 27)


@pytest.mark.parametrize("second", [at(301, 198), at(420, 200)])
def test_a_face_detected_twice_in_one_look_loses_nothing(second):
    x = float(second.box[[0, 2]].mean())
    seen = {n: [at(300, 200)] for n in range(51)} | {n: [at(x, 200)] for n in range(51, 100)}
    seen[50] = [at(300, 200), second]
    assert middles(one_face(seen)) == [300.0] * 51 + [x] * 49


@pytest.mark.parametrize("turned", [False, True])
def test_a_face_that_comes_near_another_does_not_take_its_track(turned):
    apart = [at(300, 200), at(430, 150)]
    near = [at(370, 200), at(430, 150)]
    seen = {n: (apart if n < 50 else near)[:: -1 if turned else 1] for n in range(100)}
    assert middles(one_face(seen)) == [300.0] * 50 + [370.0] * 50


def test_a_face_seen_now_is_not_taken_for_one_that_left_a_place_nearby_long_ago():
    left = {n: [at(300, 200), at(360, 180)] for n in range(10)}
    seen = left | {n: [at(300, 200)] for n in range(10, 40)} | {40: [at(335, 200)]}
    assert middles(one_face(seen)) == [300.0] * 40 + [335.0]
    assert sides(one_face(seen)) == {200.0}


@pytest.mark.parametrize("place", [300, 900])
@pytest.mark.parametrize("side", [120, 100, 350])
@pytest.mark.parametrize("gap", [0, 30])
def test_a_face_of_another_size_never_stands_in(place, side, gap):
    seen = {n: [at(300, 200)] for n in range(50)} | {n: [] for n in range(50, 50 + gap)}
    seen |= {50 + gap + n: [at(place, side)] for n in range(10)}
    seen |= {60 + gap + n: [at(300, 200)] for n in range(40)}
    chosen = one_face(seen)
    assert (sides(chosen), len(chosen)) == ({200.0}, 90)


def test_a_lone_face_of_like_size_is_kept_after_a_gap_and_a_cut():
    seen = {n: [at(300, 200)] for n in range(50)} | {n: [] for n in range(50, 90)}
    seen |= {n: [at(900, 140)] for n in range(90, 100)}
    assert middles(one_face(seen)) == [300.0] * 50 + [900.0] * 10


def test_a_close_up_whose_box_gets_flat_in_a_blink_is_kept_whole():
    flat = Detection(np.zeros((9, 2)), np.zeros((1, 5, 2)), np.array([200.0, 95.0, 400.0, 105.0]), (0.0,))
    seen = {n: [flat if 4 <= n < 7 else at(300, 200)] for n in range(12)}
    assert sorted(one_face(seen)) == list(range(12))


class Mesh:
    """Sees the bright squares of a picture that are a tenth of its longer side or more."""

    def faces(self, picture):
        rows, columns = np.nonzero(picture[:, :, 0] > 0)
        found = []
        for level in np.unique(picture[rows, columns, 0]):
            y, x = np.nonzero(picture[:, :, 0] == level)
            box = np.array([x.min(), y.min(), x.max() + 1, y.max() + 1], float)
            if box[2] - box[0] >= max(picture.shape[:2]) / 10:
                found.append(Detection(np.zeros((18, 2)), np.zeros((2, 5, 2)), box, (0.0, 0.0)))
        return found


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("side", "more"), [(70, 1), (20, 0)])
def test_a_face_too_small_next_to_the_whole_picture_is_seen_in_a_part_of_it(turned, side, more):
    picture = np.zeros((400, 1000, 3), np.uint8)
    picture[100:300, 100:300] = 200
    picture[200 : 200 + side, 800 : 800 + side] = 100
    picture = picture.swapaxes(0, 1) if turned else picture
    seen = Mesh().faces(picture)
    assert len(seen) == 1
    assert further_faces(Mesh(), picture, seen) == more
