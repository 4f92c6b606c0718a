"""Means of a factor of which each participant saw some levels only."""

import pytest

from server.results.service import margins

# Three faces; each of three people saw two of them, with both profiles.
MEANS = {
    "p1": {("f1", "slow"): 2.0, ("f1", "fast"): 4.0, ("f2", "slow"): 3.0, ("f2", "fast"): 5.0},
    "p2": {("f2", "slow"): 1.0, ("f2", "fast"): 3.0, ("f3", "slow"): 3.0, ("f3", "fast"): 5.0},
    "p3": {("f3", "slow"): 4.0, ("f3", "fast"): 6.0, ("f1", "slow"): 4.0, ("f1", "fast"): 6.0},
}


def test_each_face_has_the_mean_of_those_who_saw_it() -> None:
    face, profile, both = margins(MEANS, ["face", "profile"], ["face"])
    assert {mean.levels["face"]: mean.mean for mean in face.means} == pytest.approx(
        {"f1": 4.0, "f2": 3.0, "f3": 4.5}
    )
    assert {mean.levels["profile"]: mean.mean for mean in profile.means} == pytest.approx(
        {"slow": (2.5 + 2.0 + 4.0) / 3, "fast": (4.5 + 4.0 + 6.0) / 3}
    )
    cells = {(mean.levels["face"], mean.levels["profile"]): mean.mean for mean in both.means}
    assert cells[("f2", "slow")] == pytest.approx(2.0)
    assert len(cells) == 6
    assert {mean.participants for mean in face.means} == {2}
