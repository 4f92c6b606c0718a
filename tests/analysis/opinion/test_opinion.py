"""Opinion scores against R (tests/golden/r/opinion.R), and what repeats and screening do."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.opinion import OpinionResult, fit_opinion
from analysis.votes import bt500_counts, read_votes
from experiments.errors import InputError

FOLDER = Path(__file__).parents[2] / "golden/r/opinion"
REFERENCE: dict[str, Any] = json.loads((FOLDER / "reference.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def result() -> OpinionResult:
    return fit_opinion(read_votes(FOLDER / "votes.csv", "clip", "id", "score"))


def test_means_and_intervals_equal_r(result: OpinionResult) -> None:
    for item in result.items:
        expected = REFERENCE["items"][item.name]
        assert (item.mos, item.sd, item.n) == pytest.approx(
            (expected["mos"], expected["sd"], expected["n"]), rel=1e-12
        )
        assert (item.ci_low, item.ci_high) == pytest.approx((expected["low"], expected["high"]), rel=1e-9)


def test_the_subject_model_equals_r(result: OpinionResult) -> None:
    np.testing.assert_allclose([item.recovered for item in result.items], REFERENCE["psi"], rtol=1e-6)
    np.testing.assert_allclose([item.recovered_se for item in result.items], REFERENCE["se"], rtol=1e-6)
    np.testing.assert_allclose([one.bias for one in result.participants], REFERENCE["bias"], atol=1e-6)
    np.testing.assert_allclose(
        [one.inconsistency for one in result.participants], REFERENCE["inconsistency"], rtol=1e-6
    )
    assert sum(one.bias for one in result.participants) == pytest.approx(0, abs=1e-9)
    assert result.participants[0].name == "01"


def test_repeats_count_once_or_each(tmp_path: Path) -> None:
    path = tmp_path / "votes.csv"
    path.write_text("clip,id,score\nx,a,1\nx,a,3\nx,b,5\ny,a,2\ny,b,4\n")
    votes = read_votes(path, "clip", "id", "score")
    assert (fit_opinion(votes).items[0].mos, fit_opinion(votes).items[0].n) == (3.5, 2)
    each = fit_opinion(votes, "votes").items[0]
    assert (each.mos, each.n) == (3.0, 3)
    assert any("rated an item more than once" in one for one in fit_opinion(votes).decisions)


def test_bt500_rejects_who_is_far_off_on_both_sides() -> None:
    rng = np.random.default_rng(0)
    quality = np.tile([2.0, 4.0], 20)
    scores = quality + rng.normal(0, 0.1, (24, 40))
    scores[0] = quality + np.tile([3.0, 3.0, -3.0, -3.0], 10)
    assert bt500_counts(scores)[2].tolist() == [True, *[False] * 23]


def test_the_command(tmp_path: Path) -> None:
    out = tmp_path / "mos.json"
    arguments = [
        "opinion",
        str(FOLDER / "votes.csv"),
        "--item",
        "clip",
        "--participant",
        "id",
        "--rating",
        "score",
    ]
    done = CliRunner().invoke(app, [*arguments, "--json", str(out)])
    assert done.exit_code == 0, done.output
    told = json.loads(out.read_text())
    assert {"name", "mos", "sd", "n", "ci_low", "ci_high"} <= told["items"][0].keys()
    assert {"name", "bias", "inconsistency"} <= told["participants"][0].keys()


def test_bad_tables_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "votes.csv"
    path.write_text("clip,id,score\nx,a,1\nx,b,2\n")
    with pytest.raises(InputError, match="two people and two items or more, got 2 and 1"):
        fit_opinion(read_votes(path, "clip", "id", "score"))
    path.write_text("clip,id,score\nx,a,good\n")
    with pytest.raises(InputError, match="'score' should be a number, got 'good' in line 2"):
        read_votes(path, "clip", "id", "score")


def test_codes_for_missing_are_named(tmp_path: Path) -> None:
    path = tmp_path / "votes.csv"
    rows = [f"p{i},c{j},{-99 if i == j else i * j % 5 + 1}" for i in range(9) for j in range(6)]
    path.write_text("\n".join(["id,clip,score", *rows]))
    call = ["opinion", str(path), "--item", "clip", "--participant", "id", "--rating", "score"]
    told = " ".join(CliRunner().invoke(app, call).output.split())
    assert "'score' has -99" in told
    assert "they were counted: correct them or leave them empty" in told


def test_repeated_votes_reach_the_recovered_scores() -> None:
    """R, vote by vote."""
    theirs = REFERENCE["repeated"]
    votes = read_votes(FOLDER / "repeated.csv", "clip", "id", "score")
    each, mean = fit_opinion(votes, "votes"), fit_opinion(votes)
    np.testing.assert_allclose([item.recovered for item in each.items], theirs["psi"], rtol=1e-6)
    np.testing.assert_allclose([item.recovered_se for item in each.items], theirs["se"], rtol=1e-6)
    np.testing.assert_allclose([one.bias for one in each.participants], theirs["bias"], atol=1e-6)
    np.testing.assert_allclose(
        [one.inconsistency for one in each.participants], theirs["inconsistency"], rtol=1e-6
    )
    assert [item.recovered for item in mean.items] != pytest.approx(theirs["psi"], rel=1e-3)


PUBLISHED = Path(__file__).parents[4] / "shared/data/published"


@pytest.mark.skipif(not PUBLISHED.exists(), reason="../shared/data/published is not here")
@pytest.mark.parametrize(
    ("file", "reference"),
    [
        ("p910-reference/long.csv", "p910-reference/published.json"),
        ("bt500-reference/small_long.csv", "bt500-reference/reference_small.json"),
    ],
)
def test_the_error_of_each_item_is_that_of_the_published_reference(file: str, reference: str) -> None:
    theirs = json.loads((PUBLISHED / reference).read_text(encoding="utf-8"))
    ours = fit_opinion(read_votes(PUBLISHED / file, "item", "person", "rating"), "votes")
    np.testing.assert_allclose([item.recovered_se for item in ours.items], theirs["sos_j"], atol=1e-9)
    np.testing.assert_allclose([item.recovered for item in ours.items], theirs["mos_j"], atol=1e-7)
