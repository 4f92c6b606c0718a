"""The lid network's pictures carry their truth along; training runs where torch is."""

import json

import cv2
import numpy as np
import pytest

from tools.lid_network.augment import SIZE, _bent, _placement, _taken, example
from tools.lid_network.pictures import CURVE, CUT, actor_eyes, cut_out


@pytest.fixture(scope="module")
def cuts():
    return [cut_out(eye) for eye in actor_eyes(1)]


def test_every_eye_has_one_size(cuts):
    for cut in cuts:
        ends = cut["lids"][:, [0, -1]]
        assert cut["lids"].shape == (2, CURVE, 2)
        assert np.hypot(*(ends[0, 1] - ends[0, 0])) == pytest.approx(96)
        assert cut["picture"].shape == (*CUT[::-1], 3)


def test_points_go_where_the_picture_goes():
    rng = np.random.default_rng(4)
    for _ in range(20):
        dot = np.zeros(CUT[::-1], np.float32)
        at = rng.uniform([70, 60], [120, 100])
        cv2.circle(dot, np.round(at * 16).astype(int).tolist(), 16 * 5, 1.0, -1, cv2.LINE_AA, 4)
        matrix, bend = _placement(rng), rng.normal(0, 0.0022, 2)
        seen = _bent(dot, matrix, bend)
        rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
        middle = np.array([(seen * columns).sum(), (seen * rows).sum()]) / max(seen.sum(), 1e-9)
        if seen.sum() > 20 and (middle > 4).all() and (middle < np.array(SIZE) - 5).all():
            assert np.hypot(*(middle - _taken(at[None], matrix, bend)[0])) < 0.5


def test_an_example_is_the_same_for_the_same_number(cuts):
    one, two = (
        example(cuts[0]["picture"], cuts[0]["lids"], cuts[0]["iris"], 1.0, np.random.default_rng(3))
        for _ in range(2)
    )
    assert np.array_equal(one.picture, two.picture)
    assert one.picture.shape == SIZE[::-1]
    assert abs(float(one.picture.mean())) < 1e-3
    assert one.lids[0, 0, 0] < one.lids[0, -1, 0]


def test_a_stopped_training_goes_on(cuts, tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("onnx")
    from tools.lid_network.train import main

    names = [f"actor {k}" for k in range(8)]
    many = {key: np.array([cuts[k % len(cuts)][key] for k in range(8)]) for key in cuts[0]}
    np.savez(tmp_path / "eyes.npz", **(many | {"source": np.array(names)}))
    for steps in (50, 52):
        main([str(tmp_path / "out"), str(tmp_path / "eyes.npz"), "--steps", str(steps), "--workers", "1"])
    card = json.loads((tmp_path / "out" / "card.json").read_text())
    assert card["steps"] == 52
    assert (tmp_path / "out" / "lids.onnx").stat().st_size < 3_000_000
