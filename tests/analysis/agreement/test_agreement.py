"""Reliability and agreement against R (tests/golden/r/agreement.R) and a published example."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.agreement import LEVELS, _is_maximum, _one_factor, agreement, read_items, reliability
from analysis.cli import app
from analysis.votes import read_votes
from experiments.errors import InputError

FOLDER = Path(__file__).parents[2] / "golden/r/agreement"
REFERENCE: dict[str, Any] = json.loads((FOLDER / "reference.json").read_text(encoding="utf-8"))
ITEMS = ["calm", "glad", "tense", "awake", "warm"]
# Krippendorff (2011), example C: four observers, twelve units
PUBLISHED = """
1 2 3 3 2 1 4 1 2 . . .
1 2 3 3 2 2 4 1 2 5 . 3
. 3 3 3 2 3 4 2 2 5 1 .
1 2 3 3 2 4 4 1 2 5 1 .
"""


def votes_file(folder: Path, lines: list[str]) -> Path:
    path = folder / "votes.csv"
    path.write_text("\n".join(["id,clip,score", *lines]), encoding="utf-8")
    return path


def test_alpha_omega_and_items_equal_r() -> None:
    result = reliability(read_items(FOLDER / "items.csv", ITEMS, ["tense"], (1, 7), "id"))
    assert result.alpha == pytest.approx(REFERENCE["alpha"], rel=1e-12)
    # pingouin rounds the interval to three decimals
    assert (result.alpha_low, result.alpha_high) == pytest.approx(REFERENCE["feldt"], abs=5e-4)
    assert result.omega == pytest.approx(REFERENCE["omega"], rel=1e-5)
    assert [item.loading for item in result.items] == pytest.approx(REFERENCE["loadings"], rel=1e-4)
    assert [item.item_rest_correlation for item in result.items] == pytest.approx(
        REFERENCE["rest"], rel=1e-12
    )
    assert [item.alpha_without for item in result.items] == pytest.approx(REFERENCE["without"], rel=1e-12)


def test_scale_scores_are_means_with_reverse_keyed_items_turned(tmp_path) -> None:
    path = tmp_path / "items.csv"
    path.write_text("id,a,b\nx,1,7\ny,4,4\nz,7,2\nw,5,\n", encoding="utf-8")
    data = read_items(path, ["a", "b"], ["b"], (1, 7), "id")
    result = reliability(data)
    assert result.scores == (("x", 1.0), ("y", 4.0), ("z", 6.5))
    assert result.omega is None
    assert "needs 3 items" in result.omega_reason
    assert data.decisions == ("1 case without an answer to every item excluded (line 5)",)


def test_intraclass_correlations_equal_r() -> None:
    result = agreement(read_votes(FOLDER / "votes.csv", "clip", "id", "score"))
    assert {one.form: one.icc for one in result.icc} == pytest.approx(REFERENCE["icc"], rel=1e-10)
    consistent = next(one for one in result.icc if one.form == "ICC(C,1)")
    assert (consistent.ci_low, consistent.ci_high) == pytest.approx(REFERENCE["consistency"], rel=1e-9)
    assert (result.n_items, result.n_complete_items) == (12, 10)


@pytest.mark.parametrize("level", LEVELS)
def test_krippendorffs_alpha_equals_r(level) -> None:
    result = agreement(read_votes(FOLDER / "votes.csv", "clip", "id", "score"), level)
    assert result.krippendorff_alpha == pytest.approx(REFERENCE["krippendorff"][level], rel=1e-9)
    assert result.ci_low < result.krippendorff_alpha < result.ci_high


@pytest.mark.parametrize(("level", "alpha"), list(zip(LEVELS, (0.743, 0.815, 0.849, 0.797), strict=True)))
def test_krippendorffs_own_example(tmp_path, level, alpha) -> None:
    rows = [row.split() for row in PUBLISHED.strip().splitlines()]
    lines = [f"o{i},u{k:02d},{v}" for i, row in enumerate(rows) for k, v in enumerate(row)]
    result = agreement(read_votes(votes_file(tmp_path, lines), "clip", "id", "score"), level)
    assert round(result.krippendorff_alpha, 3) == alpha
    # the unit that one observer rated says nothing about agreement
    assert any("1 item was rated by only one person" in decision for decision in result.decisions)


def test_who_rated_what_nobody_else_did_is_not_a_rater(tmp_path) -> None:
    lines = [f"{who},c{clip},{1 + (clip + k) % 5}" for k, who in enumerate("ab") for clip in range(6)]
    result = agreement(read_votes(votes_file(tmp_path, [*lines, "z,own,3"]), "clip", "id", "score"))
    assert (result.n_people, result.n_items, result.n_complete_items) == (2, 6, 6)
    assert result.icc


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["a,c1,1", "a,c2,2"], "expected two people or more"),
        (["a,c1,3", "b,c1,3", "a,c2,3", "b,c2,3"], "every rating is 3"),
    ],
)
def test_what_says_nothing_of_agreement_is_refused(tmp_path, lines, said) -> None:
    with pytest.raises(InputError, match=said):
        agreement(read_votes(votes_file(tmp_path, lines), "clip", "id", "score"))


@pytest.mark.parametrize(
    ("items", "reverse", "scale", "said"),
    [
        (["calm"], [], None, "two items or more"),
        (["calm", "glad"], ["warm"], (1, 7), "not one of the items calm, glad"),
        (["calm", "glad"], ["glad"], None, "scale: add, for example, --scale 1:7"),
        (["calm", "glad"], [], (1, 5), "outside the scale 1 to 5"),
        (["calm", "happy"], [], None, "no column 'happy'"),
    ],
)
def test_items_that_are_not_a_scale_are_refused(items, reverse, scale, said) -> None:
    with pytest.raises(InputError, match=said):
        read_items(FOLDER / "items.csv", items, reverse, scale)


def test_an_item_that_follows_from_another_has_no_omega(tmp_path) -> None:
    path = tmp_path / "items.csv"
    random = np.random.default_rng(1)
    lines = [f"{a},{b},{8 - a}" for a, b in random.integers(1, 8, size=(20, 2))]
    path.write_text("\n".join(["a,b,c", *lines]), encoding="utf-8")
    result = reliability(read_items(path, ["a", "b", "c"]))
    assert result.omega is None
    assert "is determined by the others" in result.omega_reason


def test_the_commands_print_and_write(tmp_path) -> None:
    out, scores = tmp_path / "r.json", tmp_path / "s.csv"
    call = ["reliability", str(FOLDER / "items.csv"), "--items", ",".join(ITEMS), "--reverse", "tense"]
    told = CliRunner().invoke(
        app, [*call, "--scale", "1:7", "--case", "id", "--scores", str(scores), "--json", str(out)]
    )
    assert told.exit_code == 0, told.output
    assert json.loads(out.read_text())["omega"] == pytest.approx(REFERENCE["omega"], rel=1e-5)
    assert len(scores.read_text().splitlines()) == 61
    call = [
        "agreement",
        str(FOLDER / "votes.csv"),
        "--item",
        "clip",
        "--participant",
        "id",
        "--rating",
        "score",
    ]
    told = CliRunner().invoke(app, [*call, "--json", str(out)])
    assert told.exit_code == 0
    assert "ICC(A,k)" in told.output
    assert json.loads(out.read_text())["n_ratings"] == 94


def test_codes_for_missing_among_the_answers_are_named(tmp_path) -> None:
    path = tmp_path / "items.csv"
    rows = [f"{1 + i % 5},{-99 if i == 4 else 1 + i * i % 5},{1 + i % 4}" for i in range(20)]
    path.write_text("\n".join(["q1,q2,q3", *rows]))
    (said,) = read_items(path, ["q1", "q2", "q3"]).decisions
    assert "'q2' has -99 (line 6), often a code for missing values; they were counted" in said


@pytest.mark.parametrize("seed", range(6))
def test_a_factor_that_does_not_converge_is_a_reason_and_no_warning(tmp_path: Path, seed: int) -> None:
    """Items that share nothing: statsmodels says on the error stream that it did not converge."""
    file, out = tmp_path / "t.csv", tmp_path / "o.json"
    answers = np.random.default_rng(seed).integers(1, 6, (20, 3))
    file.write_text("\n".join(["a,b,c", *(",".join(map(str, row)) for row in answers)]) + "\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = CliRunner().invoke(app, ["reliability", str(file), "--items", "a,b,c", "--json", str(out)])
    assert result.exit_code == 0, result.exception
    told = json.loads(out.read_text())
    assert (told["omega"] is None) == bool(told["omega_reason"])


def test_the_likelihood_is_flat_at_the_maximum_alone() -> None:
    """Three items have one factor exactly: the loading of a is the root of r_ab r_ac / r_bc."""
    loadings = np.array([0.9, 0.6, 0.4])
    correlations = np.outer(loadings, loadings)
    np.fill_diagonal(correlations, 1.0)
    assert _is_maximum(correlations, loadings)
    assert _is_maximum(correlations, -loadings), "the sign of a factor is open"
    for item in range(3):
        for step in (-0.01, 0.01):
            assert not _is_maximum(correlations, loadings + step * np.eye(3)[item])
    assert not _is_maximum(correlations, loadings[::-1])


def noise(seed: int, shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(seed).integers(1, 6, shape).astype(float)


def common(seed: int) -> np.ndarray:
    """Three items that share most of what they say, rounded to a scale."""
    draw = np.random.default_rng(seed)
    return np.clip(np.round(draw.normal(3, 1, (26, 1)) + draw.normal(0, 0.3, (26, 3))), 1, 7)


@pytest.mark.parametrize("answers", [common(12), common(3), noise(31, (28, 5)), noise(5, (11, 5))])
def test_omega_is_the_same_in_every_run(answers: np.ndarray) -> None:
    """From a start drawn again the fit sometimes ended at another maximum, or without one."""
    ends = {str(_one_factor(answers)) for _ in range(8)}
    assert len(ends) == 1


def test_an_item_with_nothing_of_its_own_is_a_reason_and_no_warning() -> None:
    """Statsmodels warns of uniquenesses that are nearly zero, by a line of its source."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ends = [_one_factor(noise(seed, (30, 3))) for seed in range(12)]
    assert any("Heywood" in reason for _, reason in ends)
    assert all((loadings is None) == bool(reason) for loadings, reason in ends)
