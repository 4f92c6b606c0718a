"""Elo ratings: the rule, the order, the limit, and intervals."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import special
from typer.testing import CliRunner

from analysis.cli import app
from analysis.pairs.abilities import fit_abilities
from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons
from analysis.pairs.jod_and_elo import rate_elo
from experiments.errors import InputError


def of_rows(rows: list[tuple[str, str, int]], raters: list[str] | None = None) -> Comparisons:
    """Comparisons from (left, right, outcome)."""
    items = tuple(sorted({name for row in rows for name in row[:2]}))
    sides = [np.array([items.index(row[k]) for row in rows]) for k in (0, 1)]
    outcome = np.array([row[2] for row in rows])
    names, codes = np.unique(raters or [], return_inverse=True)
    return Comparisons(
        items, *sides, outcome, codes if raters else None, tuple(map(str, names)), "made", True, ()
    )


def simulated(n: int = 1200) -> Comparisons:
    """Four items one log odds apart in steps of 0.4."""
    random, worth = np.random.default_rng(1), 0.4 * np.arange(4)
    left = random.integers(4, size=n)
    right = (left + random.integers(1, 4, size=n)) % 4
    outcome = np.where(random.random(n) < special.expit(worth[left] - worth[right]), LEFT, RIGHT)
    raters = tuple(f"r{k:02d}" for k in range(40))
    return Comparisons(tuple("abcd"), left, right, outcome, np.arange(n) % 40, raters, "made", True, ())


def test_one_pass_follows_elos_rule() -> None:
    """1500 against 1500 moves 16; then 1484 beats 1516: it gains 32 (1 - 1 / (1 + 10^(32/400)))."""
    result = rate_elo(of_rows([("a", "b", LEFT), ("a", "b", RIGHT)]), samples=0)
    gain = 32 * (1 - 1 / (1 + 10 ** (32 / 400)))
    assert [item.as_recorded for item in result.items] == pytest.approx([1516 - gain, 1484 + gain])
    tied = rate_elo(of_rows([("a", "b", LEFT), ("a", "b", TIE)]), samples=0)
    loss = 32 * (1 / (1 + 10 ** (-32 / 400)) - 0.5)
    assert [item.as_recorded for item in tied.items] == pytest.approx([1516 - loss, 1484 + loss])
    assert tied.items[0].elo_low is None


def test_both_orders_of_two_comparisons_are_averaged() -> None:
    """A win and a loss: in either order the last winner is ahead, so that the mean is 1500."""
    result = rate_elo(of_rows([("a", "b", LEFT), ("a", "b", RIGHT)]), samples=2000)
    gain = 32 * (1 - 1 / (1 + 10 ** (32 / 400)))
    assert result.items[0].elo == pytest.approx(1500, abs=0.2)
    assert result.items[0].sd_order == pytest.approx(gain - 16, rel=0.01)


def test_order_of_rows_changes_one_pass_but_not_the_rating() -> None:
    own = simulated()
    turned = Comparisons(
        own.items, own.left[::-1], own.right[::-1], own.outcome[::-1], own.participant[::-1],
        own.participants, "made", True, (),
    )  # fmt: skip
    one, other = rate_elo(own, samples=200), rate_elo(turned, samples=200)
    for a, b in zip(one.items, other.items, strict=True):
        assert a.elo == pytest.approx(b.elo, abs=4 * a.sd_order * np.sqrt(2 / 200))
        assert a.bradley_terry == pytest.approx(b.bradley_terry)
    assert max(abs(a.as_recorded - b.as_recorded) for a, b in zip(one.items, other.items, strict=True)) > 15


def test_rating_tends_to_maximum_likelihood_and_intervals_cover_it() -> None:
    own = simulated(4000)
    abilities = fit_abilities(own)
    points = [1500 + 400 / np.log(10) * item.centred for item in abilities.items]
    result = rate_elo(own, k_factor=16)
    for item, expected, ability in zip(result.items, points, abilities.items, strict=True):
        assert item.bradley_terry == pytest.approx(expected)
        assert item.elo == pytest.approx(expected, abs=8)
        assert item.elo_low is not None
        assert item.elo_high is not None
        assert item.elo_low < expected < item.elo_high
        assert (item.elo_high - item.elo_low) / 3.92 > 400 / np.log(10) * ability.se_centred


def test_command_says_how_the_order_is_treated(tmp_path: Path) -> None:
    path, out = tmp_path / "pairs.csv", tmp_path / "elo.json"
    rows = ["id,left,right,winner", *(f"{k % 3},a,b,{'ab'[k % 2]}" for k in range(12))]
    path.write_text("\n".join([*rows, "1,c,a,c", "2,c,b,c"]) + "\n", encoding="utf-8")
    command = ["pairs", str(path), "--method", "elo", "--participant", "id", "--json", str(out)]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.exception
    assert "mean over 500 random orders" in " ".join(result.stdout.split())
    assert "c won every comparison with the others" in " ".join(result.stdout.split())
    written = json.loads(out.read_text())
    assert [item["bradley_terry"] for item in written["items"]] == [None] * 3
    assert (written["orders"], written["passes"], written["n_participants"]) == (500, 8, 3)


def test_points_per_comparison_are_positive() -> None:
    with pytest.raises(InputError, match="expected --k-factor above 0, got 0"):
        rate_elo(of_rows([("a", "b", LEFT)]), k_factor=0)


def test_complete_ties_are_refused() -> None:
    with pytest.raises(InputError, match="every comparison is a tie"):
        rate_elo(of_rows([("a", "b", TIE), ("b", "a", TIE)]))
