"""Votes that say little: people with one vote, groups without a common person, people who decide alone."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.opinion import alternating_projection, fit_opinion
from analysis.votes import read_votes

CALL = ["--item", "clip", "--participant", "id", "--rating", "score"]


def votes_of(path: Path, scores: np.ndarray, people: str = "p", items: str = "c") -> list[str]:
    lines = [
        f"{items}{j},{people}{i},{scores[i, j]:.6g}"
        for i, j in zip(*np.nonzero(np.isfinite(scores)), strict=True)
    ]
    path.write_text("\n".join(["clip,id,score", *lines]), encoding="utf-8")
    return lines


def made(people: int, items: int, seed: int = 3) -> np.ndarray:
    """Votes with known qualities 2 to 4, biases with mean 0 and inconsistencies .3 to .9."""
    rng = np.random.default_rng(seed)
    bias = rng.normal(0, 0.4, people)
    spread = np.linspace(0.3, 0.9, people)
    noise = rng.normal(size=(people, items)) * spread[:, None]
    return np.asarray(np.linspace(2, 4, items) + (bias - bias.mean())[:, None] + noise)


def test_a_person_of_one_vote_changes_no_recovered_score(tmp_path: Path) -> None:
    scores = made(10, 8)
    votes_of(tmp_path / "a.csv", scores)
    before = fit_opinion(read_votes(tmp_path / "a.csv", "clip", "id", "score"))
    one = np.full((1, 8), np.nan)
    one[0, 3] = 5.0
    votes_of(tmp_path / "b.csv", np.vstack([scores, one]))
    after = fit_opinion(read_votes(tmp_path / "b.csv", "clip", "id", "score"))
    for was, now in zip(before.items, after.items, strict=True):
        assert now.recovered == pytest.approx(was.recovered, abs=1e-6)
        assert now.recovered_se == pytest.approx(was.recovered_se, rel=1e-6)
    assert after.items[3].mos == pytest.approx((10 * before.items[3].mos + 5) / 11)
    last = next(person for person in after.participants if person.name == "p10")
    assert (last.bias, last.inconsistency, last.group) == (None, None, None)
    assert (
        "bias cannot be estimated from one vote: p10 counts in MOS, but not in recovered scores"
        in after.decisions
    )


def test_nobody_decides_alone() -> None:
    """Of votes on a scale the projection often ends in one person: errors then are those of the scores."""
    rng = np.random.default_rng(5)
    off, told, held = [], [], 0
    for _ in range(150):
        quality = rng.uniform(1.5, 4.5, 8)
        bias, spread = rng.normal(0, 0.3, (8, 1)), rng.uniform(0.2, 1.2, (8, 1))
        scores = np.clip(np.round(quality + bias + rng.normal(size=(8, 8)) * spread), 1, 5)
        fit = alternating_projection(scores)
        held += bool(fit.held.any())
        error = fit.quality - quality
        off.append(error - error.mean())
        told.append(fit.quality_se)
        assert fit.converged
        assert fit.quality_se.min() > 0.02
    assert held > 50
    ratio = np.sqrt(np.mean(np.square(told)) / np.mean(np.square(off)))
    assert 0.7 < ratio < 1.2


def test_votes_in_any_unit_give_the_same_scores() -> None:
    scores = made(9, 6)
    fit = alternating_projection(scores)
    for unit, origin in ((1e-9, 0.0), (1e9, 0.0), (1e-3, 1000.0)):
        other = alternating_projection(scores * unit + origin)
        np.testing.assert_allclose((other.quality - origin) / unit, fit.quality, atol=1e-8)
        np.testing.assert_allclose(other.quality_se / unit, fit.quality_se, rtol=1e-6)
        assert other.converged


def test_two_groups_without_a_common_person_are_named(tmp_path: Path) -> None:
    scores = np.full((12, 8), np.nan)
    scores[:6, :4] = made(6, 4, 1)
    scores[6:, 4:] = made(6, 4, 2) + 1.5
    votes_of(tmp_path / "a.csv", scores)
    done = CliRunner().invoke(
        app, ["opinion", str(tmp_path / "a.csv"), *CALL, "--json", str(tmp_path / "o.json")]
    )
    said = " ".join(done.output.split())
    assert "2 groups with no person in common (c0, c1, c2, c3 | c4, c5, c6, c7)" in said
    assert "Group" in said
    told = json.loads((tmp_path / "o.json").read_text())
    assert [item["group"] for item in told["items"]] == [1] * 4 + [2] * 4
    assert told["n_groups"] == 2
    for group in (1, 2):
        biases = [person["bias"] for person in told["participants"] if person["group"] == group]
        assert sum(biases) == pytest.approx(0, abs=1e-9)
    alone = alternating_projection(scores[:6, :4])
    np.testing.assert_allclose([item["recovered"] for item in told["items"][:4]], alone.quality, atol=0.01)


def test_items_of_one_vote_end_without_warnings(tmp_path: Path) -> None:
    scores = made(5, 6)
    scores[:, 5] = [4.0, *[np.nan] * 4]
    votes_of(tmp_path / "a.csv", scores)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        done = CliRunner().invoke(app, ["opinion", str(tmp_path / "a.csv"), *CALL], catch_exceptions=False)
    assert done.exit_code == 0
    row = next(line.split() for line in done.output.splitlines() if line.startswith("c5"))
    assert row[1:5] == ["4.00", "–", "1", "–"]


def test_people_of_one_vote_each_have_means_and_no_model(tmp_path: Path) -> None:
    lines = [f"c{i % 3},p{i},{1 + i % 5}" for i in range(12)]
    (tmp_path / "a.csv").write_text("\n".join(["clip,id,score", *lines]), encoding="utf-8")
    result = fit_opinion(read_votes(tmp_path / "a.csv", "clip", "id", "score"))
    assert all(np.isnan(item.recovered) and item.group is None for item in result.items)
    assert all(np.isfinite(item.ci_low) for item in result.items)
    assert "only people with one vote rated c0, c1, c2: no recovered score" in result.decisions


def test_votes_that_agree_exactly_have_no_error() -> None:
    quality = np.array([1.0, 2.0, 4.0])
    fit = alternating_projection(quality + np.array([[-0.5], [0.0], [0.5]]))
    np.testing.assert_allclose(fit.quality, quality, atol=1e-12)
    assert not fit.held.any()
    assert fit.quality_se.max() < 1e-6
