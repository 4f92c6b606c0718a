"""JOD with pwcmp's prior, contents, and screening; published scores are in tests/analysis/replication."""

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.pairs.abilities import fit_abilities
from analysis.pairs.comparisons import Comparisons, read_comparisons
from analysis.pairs.jod_and_elo import SIGMA, scale_jod
from experiments.errors import InputError

HEADER = "rater,scene,left,right,winner\n"


def _file(path: Path, *rows: str) -> Path:
    path.write_text(HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def _rows(raters: int = 8, scenes: str = "xy", seed: int = 1) -> list[str]:
    """Three items a < b < c, judged with noise."""
    random = np.random.default_rng(seed)
    worth = dict(zip("abc", (0.0, 0.7, 1.2), strict=True))
    rows = []
    for rater in range(raters):
        for scene in scenes:
            for left, right in (("a", "b"), ("b", "c"), ("c", "a")):
                is_left = random.normal(worth[left] - worth[right], 1) > 0
                rows.append(f"r{rater},{scene},{left},{right},{'left' if is_left else 'right'}")
    return rows


def _read(path: Path) -> Comparisons:
    return read_comparisons(path, "left", "right", "winner", None, "rater", (), "scene", same=True)


def test_without_prior_jod_are_thurstones_abilities(tmp_path: Path) -> None:
    comparisons = _read(_file(tmp_path / "pairs.csv", *_rows()))
    result = scale_jod(comparisons.by_content(), "none", "a", 10.0, bootstrap=0)
    assert [scale.content for scale in result.scales] == ["all", "x", "y"]
    for scale, own in zip(result.scales, comparisons.by_content().values(), strict=True):
        expected = fit_abilities(own, "thurstone")
        found = [item.jod - 10.0 for item in scale.items]
        assert found == pytest.approx([item.ability * SIGMA for item in expected.items], abs=2e-5)
        assert scale.log_likelihood == pytest.approx(expected.log_likelihood, rel=1e-9)
        assert [item.wins for item in scale.items] == [item.wins for item in expected.items]


def test_a_content_is_not_called_as_all_together(tmp_path: Path) -> None:
    rows = [row.replace(",x,", ",all,") for row in _rows()]
    with pytest.raises(InputError, match="a content is called all, as all contents together; rename it"):
        _read(_file(tmp_path / "pairs.csv", *rows)).by_content()


def test_order_of_rows_and_sides_changes_nothing(tmp_path: Path) -> None:
    rows = _rows()
    turned = [
        f"{r},{s},{b},{a},{'right' if w == 'left' else 'left'}"
        for r, s, a, b, w in (row.split(",") for row in reversed(rows))
    ]
    one, other = (
        scale_jod(_read(_file(tmp_path / f"{k}.csv", *given)).by_content(), bootstrap=50)
        for k, given in enumerate((rows, turned))
    )
    for first, second in zip(one.scales, other.scales, strict=True):
        for a, b in zip(first.items, second.items, strict=True):
            assert (a.jod, a.jod_low, a.jod_high) == pytest.approx((b.jod, b.jod_low, b.jod_high), abs=1e-4)
            assert a.jod_low is not None
            assert a.jod_high is not None
            assert a.jod_low < a.jod < a.jod_high


def test_prior_keeps_an_item_that_always_wins_finite_and_says_so(tmp_path: Path) -> None:
    rows = [row for row in _rows(scenes="x") if ",c," not in row]
    rows += [f"r{k},x,c,a,left" for k in range(8)]
    comparisons = _read(_file(tmp_path / "pairs.csv", *rows))
    result = scale_jod(comparisons.by_content(), bootstrap=0)
    assert all(np.isfinite(item.jod) for item in result.scales[0].items)
    assert all(item.jod_plain is None for item in result.scales[0].items)
    assert result.decisions == (
        "x: a lost every comparison with the others: only the prior keeps the score finite",
    )
    with pytest.raises(InputError, match="no finite score fits; use --prior gaussian"):
        scale_jod(comparisons.by_content(), "none")


def test_samples_of_raters_without_a_maximum_end_in_one_line(tmp_path: Path) -> None:
    rows = [f"r{k},x,a,b,left" for k in range(20)] + ["odd,x,a,b,right"]
    comparisons = _read(_file(tmp_path / "pairs.csv", *rows))
    assert scale_jod(comparisons.by_content(), "none", bootstrap=50).scales[0].items[0].jod_low is not None
    few = _read(
        _file(tmp_path / "few.csv", "r1,x,a,b,left", "r1,x,b,c,left", "r2,x,b,a,left", "r3,x,c,b,left")
    )
    with pytest.raises(InputError, match="in most samples of the 3 raters an item wins or loses every"):
        scale_jod(few.by_content(), "none", bootstrap=50)


def test_a_prior_that_dominates_is_reported(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    rows = [
        f"r{rater},x,i{left},i{right},{'left' if random.normal((left - right) * 0.7, 1) > 0 else 'right'}"
        for rater in range(3)
        for left, right in combinations(range(7), 2)
    ]
    rows += [f"r3,x,i{item},i{item + 1},left" for item in range(6)]
    result = scale_jod(_read(_file(tmp_path / "pairs.csv", *rows)).by_content(), bootstrap=0)
    assert any("the prior dominates: it moves" in said for said in result.decisions)


def test_contents_and_observers_without_information_are_named(tmp_path: Path) -> None:
    rows = [*_rows(), "r1,z,a,a,left", "single,x,a,b,left"]
    file = _file(tmp_path / "pairs.csv", *rows)
    result = scale_jod(_read(file).by_content(), bootstrap=0, screen=True)
    assert "excluded, with a single item: z" in result.decisions
    assert "not screened, with one answer: single" in result.decisions
    assert any("1 comparison of an item with itself counts in the prior only" in s for s in result.decisions)
    last = next(one for one in result.observers if one.name == "single")
    assert (last.n, last.log_likelihood, last.is_far) == (1, None, False)
    assert len(result.observers) == 9


def test_a_contrary_observer_is_found(tmp_path: Path) -> None:
    usual = [("b", "c", "right"), ("c", "a", "left")]
    rows = [
        f"r{rater},{scene},{left},{right},{winner}"
        for rater in range(7)
        for scene in "xy"
        for left, right, winner in [("a", "b", "right" if rater else "left"), *usual]
    ]
    contrary = [f"odd,{scene},{pair}" for scene in "xy" for pair in ("a,b,left", "c,a,right")]
    result = scale_jod(
        _read(_file(tmp_path / "p.csv", *rows, *contrary)).by_content(), bootstrap=0, screen=True
    )
    assert [one.name for one in result.observers if one.is_far] == ["odd"]
    assert result.n_far == 1


def test_commands_scale_contents(tmp_path: Path) -> None:
    file, out = _file(tmp_path / "pairs.csv", *_rows()), tmp_path / "out.json"
    runner, named = CliRunner(), ["--participant", "rater", "--by", "scene", "--json", str(out)]
    ended = runner.invoke(app, ["pairs", str(file), *named])
    assert ended.exit_code == 0, ended.output
    known = json.loads(out.read_text(encoding="utf-8"))
    assert list(known["contents"]) == ["all", "x", "y"]
    alone = _file(tmp_path / "x.csv", *(row for row in _rows() if ",x," in row))
    expected = fit_abilities(_read(alone), "bradley-terry")
    assert known["contents"]["x"]["items"][1]["ability"] == pytest.approx(expected.items[1].ability)
    jod = [*named, "--method", "jod", "--bootstrap", "100", "--screen", "--reference", "a=10"]
    ended = runner.invoke(app, ["pairs", str(file), *jod])
    assert ended.exit_code == 0, ended.output
    assert json.loads(out.read_text(encoding="utf-8"))["scales"][1]["items"][0]["jod"] == 10.0
    assert "a = 10, 48 comparisons" in ended.output


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--method", "jod", "--reference", "d"],
            "'d' is not an item of all; expected a reference that every",
        ),
        (["--method", "jod", "--screen"], "--screen compares observers; add --participant COLUMN"),
        (
            ["--method", "jod", "--firth"],
            "--method jod takes no --factors, --order-effect or --firth, and no --crossed",
        ),
        (["--screen"], "--reference, --screen and --prior are for --method jod"),
        (["--prior", "none"], "--reference, --screen and --prior are for --method jod"),
        (["--method", "jod", "--reference", "a=nan"], "--reference should be ITEM or ITEM=10, got 'a=nan'"),
        (["--method", "jod", "--winner", "tied", "--tie", "same"], "are ties, which jod does not support"),
    ],
)
def test_what_does_not_fit_is_one_line(tmp_path: Path, options: list[str], said: str) -> None:
    file = tmp_path / "pairs.csv"
    rows = [f"{row},{'same' if k == 0 else row.split(',')[-1]}" for k, row in enumerate(_rows())]
    file.write_text("rater,scene,left,right,winner,tied\n" + "\n".join(rows) + "\n", encoding="utf-8")
    ended = CliRunner().invoke(app, ["pairs", str(file), *options])
    assert isinstance(ended.exception, InputError)
    assert said in str(ended.exception)


def test_complete_ties_have_no_abilities_to_report(tmp_path: Path) -> None:
    rows = [",".join([*row.split(",")[:4], "same"]) for row in _rows()]
    file = _file(tmp_path / "pairs.csv", *rows)
    ended = CliRunner().invoke(app, ["pairs", str(file), "--tie", "same"])
    assert isinstance(ended.exception, InputError)
    assert "every comparison is a tie" in str(ended.exception)
