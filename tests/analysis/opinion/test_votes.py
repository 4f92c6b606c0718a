"""Scores and screening by the ITU's standards, against sums written out and against scipy."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.opinion import OpinionResult, fit_opinion
from analysis.votes import Screening, Standard, read_votes, screen_raters, standardized_votes
from experiments.errors import InputError

P913: Screening = {"rule": "p913", "below": 0.75}
BT500: Screening = {"rule": "bt500", "below": 0.75}


def votes_file(folder: Path, header: str, rows: list[str]) -> Path:
    path = folder / "votes.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def fitted(path: Path, standard: Standard, screening: Screening | None = None) -> OpinionResult:
    return fit_opinion(read_votes(path, "clip", "id", "score", (), standard, screening), standard=standard)


def hidden(folder: Path, rows: tuple[tuple[str, ...], ...] = ()) -> Path:
    """Three people, two sources with one processed clip each; p3 saw no reference of y."""
    votes = {
        ("p1", "x"): 5, ("p1", "x1"): 3, ("p1", "y"): 4, ("p1", "y1"): 5,
        ("p2", "x"): 4, ("p2", "x1"): 4, ("p2", "y"): 5, ("p2", "y1"): 2,
        ("p3", "x"): 5, ("p3", "x1"): 1, ("p3", "y1"): 3,
    }  # fmt: skip
    lines = [f"{p},{clip},{vote},{clip[0] if len(clip) > 1 else ''}" for (p, clip), vote in votes.items()]
    return votes_file(folder, "id,clip,score,source", [*lines, *(",".join(row) for row in rows)])


def test_differential_scores_are_against_each_persons_hidden_reference(tmp_path: Path) -> None:
    """P.910: x1 has 3, 5, 1 (3 - 5 + 5 and so on), y1 has 6 and 2; the vote of p3 on y1 has no reference."""
    standard = Standard("acr-hr", "source", highest=5)
    result = fitted(hidden(tmp_path), standard)
    assert [(one.name, one.mos, one.n) for one in result.items] == [("x1", 3.0, 3), ("y1", 4.0, 2)]
    low, high = stats.t.interval(0.95, 2, 3.0, stats.sem([3, 5, 1]))
    assert (result.items[0].ci_low, result.items[0].ci_high) == pytest.approx((low, high))
    assert "1 vote excluded, without a vote on the reference by p3" in result.decisions
    crushed = fitted(hidden(tmp_path), Standard("acr-hr", "source", highest=5, crush=True))
    assert crushed.items[1].mos == pytest.approx((7 * 6 / 8 + 2) / 2)


def test_comparisons_shown_in_either_order_count_for_the_item(tmp_path: Path) -> None:
    rows = ["p1,a,2,ref", "p2,a,-1,a", "p3,a,3,ref", "p1,b,0,b", "p2,b,-2,ref", "p3,b,1,b"]
    result = fitted(votes_file(tmp_path, "id,clip,score,first", rows), Standard("ccr", first="first"))
    assert [one.mos for one in result.items] == pytest.approx([2.0, -1.0])
    interval = stats.ttest_1samp([0, -2, -1], 0).confidence_interval()
    assert (result.items[1].ci_low, result.items[1].ci_high) == pytest.approx(tuple(interval))


def test_an_order_that_never_changes_is_named(tmp_path: Path) -> None:
    rows = ["p1,a,2,ref", "p2,a,1,ref", "p1,b,0,ref", "p2,b,1,ref"]
    result = fitted(votes_file(tmp_path, "id,clip,score,first", rows), Standard("ccr", first="first"))
    assert any("every item was shown second" in one for one in result.decisions)


def test_double_stimulus_scores_are_the_reference_minus_the_item(tmp_path: Path) -> None:
    rows = ["p1,a,60,80", "p2,a,55,90", "p3,a,70,70", "p1,b,20,85", "p2,b,35,80", "p3,b,,70"]
    result = fitted(votes_file(tmp_path, "id,clip,score,ref", rows), Standard("dscqs", "ref"))
    assert [(one.mos, one.n) for one in result.items] == [(pytest.approx(55 / 3), 3), (55.0, 2)]
    low, high = stats.ttest_rel([80, 90, 70], [60, 55, 70]).confidence_interval()
    assert (result.items[0].ci_low, result.items[0].ci_high) == pytest.approx((low, high))


def test_z_scores_are_of_each_session(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    votes = {(p, day): random.integers(1, 6, 6).astype(float) for p in "ab" for day in "12"}
    votes["b", "2"][:] = 3.0
    rows = [
        f"{p},{'uvwxyz'[k]},{value},{day}"
        for (p, day), values in votes.items()
        for k, value in enumerate(values)
    ]
    path = votes_file(tmp_path, "id,clip,score,day", rows)
    result = fitted(path, Standard(z_scores=True, session="day"))
    z = {key: stats.zscore(values, ddof=1) for key, values in votes.items() if key != ("b", "2")}
    of_a = (z["a", "1"] + z["a", "2"]) / 2
    assert [one.mos for one in result.items] == pytest.approx(((of_a + z["b", "1"]) / 2).tolist())
    assert "excluded, since their votes do not vary: b, 2" in result.decisions
    whole = fitted(path, Standard(z_scores=True))
    both = np.concatenate([votes["a", "1"], votes["a", "2"]])
    assert whole.n_votes == 24
    assert stats.zscore(both, ddof=1)[0] == pytest.approx((both[0] - both.mean()) / both.std(ddof=1))


def rated(unlike: int = 2, people: int = 20, clips: int = 30) -> np.ndarray:
    """Votes of people who agree, and of a few who answer at random or the other way round."""
    random = np.random.default_rng(5)
    quality = random.uniform(1, 5, clips)
    scores = np.clip(np.rint(quality + 0.5 * random.normal(size=(people, clips))), 1, 5)
    scores[0] = np.clip(np.rint(6 - quality), 1, 5)
    if unlike > 1:
        scores[1] = random.integers(1, 6, clips)
    return scores


def test_p913_leaves_out_the_lowest_first_and_computes_the_means_again() -> None:
    scores = rated()
    scores[3, ::4] = np.nan
    reasons = screen_raters(scores, P913)
    assert list(reasons) == [0, 1]
    first = np.corrcoef(scores[0], np.nanmean(scores, axis=0))[0, 1]
    assert reasons[0] == f"correlation {first:.2f} with the mean ratings, below 0.75"
    second = np.corrcoef(scores[1], np.nanmean(scores[1:], axis=0))[0, 1]
    assert reasons[1].startswith(f"correlation {second:.2f} ")
    assert screen_raters(scores[2:], P913) == {}


def test_p913_with_conditions_keeps_a_rater_who_is_unsteady_on_clips_alone(tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    conditions = np.repeat(np.arange(6), 8)
    quality = 1.5 + 0.5 * conditions
    scores = quality + 0.3 * random.normal(size=(10, 48))
    scores[0] = quality + 2.3 * random.normal(size=48)
    scores[1] = 6 - quality + 1.6 * random.normal(size=48)
    means = np.array([[row[conditions == k].mean() for k in range(6)] for row in scores])
    by_clip, by_condition = (np.corrcoef(t[0], t.mean(axis=0))[0, 1] for t in (scores, means))
    assert by_clip < 0.75 < 0.8 < by_condition
    assert list(screen_raters(scores, P913)) == [1, 0]
    reasons = screen_raters(scores, P913, conditions)
    assert list(reasons) == [1]
    assert f"and {np.corrcoef(means[1], means.mean(axis=0))[0, 1]:.2f} by condition" in reasons[1]
    rows = [f"p{p},c{c:02d},{value:g},q{conditions[c]},{p % 3}" for (p, c), value in np.ndenumerate(scores)]
    path = votes_file(tmp_path, "id,clip,score,codec,day", rows)
    base = ["opinion", str(path), "--item", "clip", "--participant", "id", "--rating", "score"]
    result = CliRunner().invoke(app, [*base, "--screen", "p913", "--condition", "codec"])
    said = " ".join(result.stdout.split())
    assert "P.913 excluded p1: correlation" in said
    assert "excluded p0" not in said
    for more, refusal in (
        (["--condition", "codec"], "--condition is for --screen p913"),
        (["--screen", "p913", "--condition", "day"], "has several values of 'day'"),
    ):
        assert refusal in str(CliRunner().invoke(app, [*base, *more]).exception)


def test_a_rater_who_says_the_same_of_everything_goes_and_two_raters_stay() -> None:
    scores = rated(1)
    scores[0] = 3.0
    assert list(screen_raters(scores, P913)) == [0]
    assert screen_raters(scores[:2], P913) == {}


def test_one_answer_is_not_judged_by_correlation() -> None:
    scores = rated(1)
    scores[0, 1:] = np.nan
    assert screen_raters(scores, P913) == {}


def test_command_excludes_before_scores_are_computed_and_says_whom(tmp_path: Path) -> None:
    scores = rated()
    rows = [f"p{p:02d},c{c:02d},{value:g}" for (p, c), value in np.ndenumerate(scores)]
    path, out = votes_file(tmp_path, "id,clip,score", rows), tmp_path / "mos.json"
    base = ["opinion", str(path), "--item", "clip", "--participant", "id", "--rating", "score"]
    result = CliRunner().invoke(app, [*base, "--json", str(out), "--screen", "p913"])
    assert result.exit_code == 0, result.exception
    assert "P.913 excluded p00: correlation -0." in " ".join(result.stdout.split())
    written = json.loads(out.read_text())
    assert len(written["participants"]) == 18
    assert [one["mos"] for one in written["items"]] == pytest.approx(scores[2:].mean(axis=0).tolist())
    result = CliRunner().invoke(app, [*base, "--screen", "bt500"])
    assert "BT.500 excluded" in " ".join(result.stdout.split())


def test_agreement_of_each_dimension_is_that_of_its_rows_alone(tmp_path: Path) -> None:
    scores, out = rated(people=6, clips=12), tmp_path / "a.json"
    rows = [
        f"p{p},c{c:02d},{value:g},{'nice' if c % 2 else 'real'}" for (p, c), value in np.ndenumerate(scores)
    ]
    base = ["agreement", "--item", "clip", "--participant", "id", "--rating", "score", "--json", str(out)]
    path = votes_file(tmp_path, "id,clip,score,scale", rows)
    result = CliRunner().invoke(app, [*base, str(path), "--by", "scale"])
    assert result.exit_code == 0, result.exception
    assert "votes, nice" in result.stdout
    together = json.loads(out.read_text())["dimensions"]
    alone = votes_file(tmp_path, "id,clip,score,scale", [row for row in rows if row.endswith("real")])
    CliRunner().invoke(app, [*base, str(alone)])
    assert together["real"]["icc"] == json.loads(out.read_text())["icc"]
    assert together["real"]["ci_low"] == json.loads(out.read_text())["ci_low"]
    assert together["nice"]["krippendorff_alpha"] != together["real"]["krippendorff_alpha"]


@pytest.mark.parametrize(
    ("standard", "said"),
    [
        (Standard("acr-hr", highest=5), "--method acr-hr needs --reference COLUMN"),
        (Standard("acr-hr", "source"), "needs the ends of the scale"),
        (Standard("ccr"), "--method ccr needs --first COLUMN"),
        (Standard("acr", "source"), "--reference is for --method acr-hr or dscqs"),
        (Standard("acr", first="source"), "--first is for --method ccr"),
        (Standard(session="source"), "--session is for --z-scores"),
        (Standard("acr-hr", "source", highest=7, crush=True), "--crush is for"),
        (Standard("acr-hr", "source", highest=5, z_scores=True), "--z-scores is for --method acr"),
    ],
)
def test_options_that_do_not_belong_together_are_one_line(
    tmp_path: Path, standard: Standard, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        fitted(hidden(tmp_path), standard)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (("p1", "z1", "3", "z"), "nobody rated 'z', the reference of 'z1'"),
        (("p2", "x1", "3", "y"), "item 'x1' has several references: x, y"),
    ],
)
def test_references_that_do_not_fit_are_named(tmp_path: Path, row: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError, match=said):
        fitted(hidden(tmp_path, (row,)), Standard("acr-hr", "source", highest=5))


def test_repeats_of_differential_scores_are_refused(tmp_path: Path) -> None:
    standard = Standard("acr-hr", "source", highest=5)
    votes = read_votes(hidden(tmp_path), "clip", "id", "score", (), standard)
    with pytest.raises(InputError, match="--repeats votes is not for --method acr-hr"):
        fit_opinion(votes, "votes", standard)


@pytest.mark.parametrize("vote", [0.1, 3.3, 4.0])
def test_a_person_who_never_varies_has_no_z_scores(vote: float) -> None:
    values = np.array([vote] * 6 + [1.0, 2.0, 3.0])
    scores = standardized_votes(values, np.array([0] * 6 + [1] * 3))
    assert np.isnan(scores[:6]).all()
    assert scores[6:] == pytest.approx([-1, 0, 1])
