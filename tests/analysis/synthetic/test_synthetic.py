"""Synthetic participants: published figures to the printed digits, wishes, marks, and bad input."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from analysis.synthetic.published import DesignSpace, PrintedMean, load_published, prints_as, window
from analysis.synthetic.repair import MoveLoss, test_after_moves, test_value
from analysis.synthetic.synthesise import make_plan, synthesise
from analysis.synthetic.targets import make_feasible
from analysis.synthetic.trials import split_sum, write_ratings
from analysis.within.anova import within_anova
from analysis.within.cell_means import cell_table
from analysis.within.pairwise import one_factor_pairs
from experiments.errors import InputError
from experiments.kinds import trials_per_participant
from experiments.kinds.clip_rating import RATINGS
from experiments.load import load_experiment

for name in ("test_after_moves", "test_value"):
    globals()[name].__test__ = False


def read_rows(path):
    import pandas as pd

    rows = pd.read_csv(path, dtype=str, keep_default_na=False)
    return rows.assign(response=rows["response"].astype(float))


@pytest.mark.parametrize(("name", "seed"), [("exp1", 1), ("exp1", 7), ("exp2", 1), ("exp3", 1), ("exp3", 2)])
def test_the_ratings_give_every_printed_figure(name, seed, tmp_path):
    """From the written file alone, with the ANOVA of the package, not with the search's own statistics."""
    plan = make_plan(name)
    made = synthesise(plan, seed)
    assert not made.missed
    write_ratings([made], tmp_path / "ratings.csv")
    rows = read_rows(tmp_path / "ratings.csv")
    factors = list(plan.space.factors)
    levels = dict(zip(plan.space.factors, plan.space.levels, strict=True))
    table = cell_table(rows, "participant", "response", factors, levels)
    anova = within_anova(table.y, table.factors, table.levels)
    for printed in plan.published.tests:
        test = anova.effect(printed.effect).multivariate
        assert printed.f is None or prints_as(test.f_value, printed.f), printed
        assert printed.p is None or prints_as(test.p_value, printed.p), printed
    for mean in plan.published.means:
        chosen = rows[np.logical_and.reduce([rows[f] == lv for f, lv in mean.at.items()])]
        assert prints_as(chosen.groupby("participant")["response"].mean().mean(), mean.printed), mean
    for spread in plan.published.spreads:
        chosen = rows[np.logical_and.reduce([rows[f] == lv for f, lv in spread.at.items()])]
        sd = chosen.groupby("participant")["response"].mean().std(ddof=1)
        value = sd / np.sqrt(len(table.participants)) if spread.kind == "se" else sd
        assert prints_as(value, spread.printed), spread
    for declared in plan.published.pairs:
        spared = {frozenset(pair) for pair in declared.exceptions}
        for pair in one_factor_pairs(anova):
            if pair.effect == declared.factor:
                significant = pair.p_bonferroni < declared.all_significant_below
                assert significant == (frozenset((pair.level_a, pair.level_b)) not in spared), pair


def test_exp2_orders_and_highest_cells():
    made = synthesise(make_plan("exp2"), 3)
    means = made.y.mean(axis=0)
    for character in range(2):
        profile = means[:, :, character].mean(axis=1)
        assert (np.diff(profile) < 0).all()
    assert means.argmax() == np.ravel_multi_index((0, 1, 0), means.shape)
    assert list(means.mean(axis=(0, 2)).argsort()[::-1]) == [1, 0, 2, 3]
    assert means[:, :, 1].mean(axis=0).argmax() == 0


def test_the_impossible_mean_is_named_with_its_reason():
    plan = make_plan("exp1")
    (given_way,) = plan.given_way
    assert given_way.at == {"profile": "real"}
    assert (given_way.printed, given_way.used) == ("4.10", "4.09")
    assert "'profile' needs a grand mean of at least 4.2000" in str(given_way)
    assert not make_plan("exp2").given_way
    assert not make_plan("exp3").given_way


def test_every_row_is_marked_and_has_the_columns_of_the_export(tmp_path):
    plan = make_plan("exp3", 12)
    out = tmp_path / "ratings.csv"
    count = write_ratings([synthesise(plan, 4)], out)
    experiment = load_experiment("exp3")
    with out.open(newline="", encoding="utf-8") as handle:
        reader = csv.DictReader(handle)
        rows = list(reader)
    assert reader.fieldnames == RATINGS.csv_header(experiment.factor_names)
    assert count == len(rows) == 12 * trials_per_participant(experiment)
    assert {row["synthetic"] for row in rows} == {"1"}
    assert {row["study"] for row in rows} == {"synthetic exp3"}
    first = [row for row in rows if row["participant"] == "S001"]
    assert [int(row["trial_index"]) for row in first] == list(range(len(first)))
    assert [path.name for path in tmp_path.iterdir()] == ["ratings.csv"]


def test_same_seed_same_file(tmp_path):
    plan = make_plan("exp3")
    for name in ("a.csv", "b.csv"):
        write_ratings([synthesise(plan, 9)], tmp_path / name)
    write_ratings([synthesise(plan, 10)], tmp_path / "c.csv")
    first = (tmp_path / "a.csv").read_bytes()
    assert first == (tmp_path / "b.csv").read_bytes()
    assert first != (tmp_path / "c.csv").read_bytes()


def test_wishes_replace_printed_figures():
    plan = make_plan("exp3", 30, ["lower_lid.both=4.90"], ["lower_lid=6.50"])
    made = synthesise(plan, 1)
    assert not made.missed
    assert f"{made.y[:, 0].mean():.2f}" == "4.90"
    test = within_anova(made.y, made.space.factors, made.space.levels).effect("lower_lid").multivariate
    assert f"{test.f_value:.2f}" == "6.50"


def test_another_number_of_participants_keeps_the_printed_f_not_its_p():
    blur = next(t for t in make_plan("exp1", 60).targets.tests if t.name == "F blur")
    assert (blur.low, blur.high) == pytest.approx((0.9455, 0.9545))


def test_an_effect_wished_away_takes_its_printed_means_along():
    plan = make_plan("exp1", effects=["blur=0"])
    assert not any(set(m.at) == {"blur"} for m in plan.published.means)
    assert any(set(m.at) == {"profile"} for m in plan.published.means)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("exp9",), "no experiment 'exp9'"),
        (("exp3", 4), "at least 5 participants"),
        (("exp3", None, ["lower_lid=4"]), "factor.level=4.80"),
        (("exp3", None, ["lower_lid.boht=4"]), "did you mean 'both'"),
        (("exp3", None, [], ["lowerlid=4"]), "did you mean 'lower_lid'"),
        (("exp3", None, [], ["lower_lid=big"]), "expected a number"),
        (("exp1", None, ["profile.real=6.00"]), "contradict each other"),
    ],
)
def test_bad_wishes_are_one_clear_line(arguments, said):
    with pytest.raises(InputError, match=said):
        make_plan(*arguments)


def test_means_that_only_just_agree_are_left_alone():
    space = DesignSpace(("a", "b"), (("x", "y"), ("u", "v")))
    means = [({"a": "x"}, "4.00"), ({"a": "y"}, "4.00"), ({"b": "u"}, "3.99"), ({"b": "v"}, "4.00")]
    published = load_published("exp3").model_copy(
        update={"means": tuple(PrintedMean(at=at, printed=text) for at, text in means)}
    )
    assert make_feasible(published, space)[1] == ()


@given(st.integers(1, 60), st.data())
@settings(max_examples=60, deadline=None)
def test_split_sum_gives_whole_ratings_with_that_sum(count, data):
    total = data.draw(st.integers(count, 7 * count))
    ratings = split_sum(total, np.full(count, total / count), 1, 7, np.random.default_rng(count))
    assert ratings.sum() == total
    assert ratings.min() >= 1
    assert ratings.max() <= 7


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_every_move_is_foreseen_exactly(seed):
    """Rank-two updates give the same F as computing it afresh, for a block and for one contrast."""
    rng = np.random.default_rng(seed)
    y = rng.normal(4, 1, (9, 6))
    step = np.array([0.05, -0.05])
    for q in (1, 3):
        contrasts = np.linalg.qr(rng.normal(size=(6, q)))[0]
        after = test_after_moves(y, contrasts, step)
        sign, person, cell = (int(rng.integers(size)) for size in after.shape)
        moved = y.copy()
        moved[person, cell] += step[sign]
        assert after[sign, person, cell] == pytest.approx(test_value(moved, contrasts), rel=1e-8)


def test_loss_after_a_move_is_the_loss_of_the_moved_data():
    plan = make_plan("exp1")
    rng = np.random.default_rng(0)
    loss = MoveLoss(plan.targets, 16)
    y = rng.normal(4, 0.6, (32, 16))
    nothing, move = np.array([1e-12]), np.array([0.05])
    after = loss.after_moves(y, move)
    moved = y.copy()
    moved[5, 3] += 0.05
    assert loss.after_moves(moved, nothing)[0, 0, 0] == pytest.approx(after[0, 5, 3], rel=1e-6)


def test_windows_of_printed_figures():
    assert window("4.10") == pytest.approx((4.095, 4.105))
    assert window("<0.001") == (0.0, 0.001)
    assert prints_as(0.0004, "<0.001")
    assert not prints_as(0.04, ">0.05")
    assert stats.f.sf(9.93, 1, 31) == pytest.approx(0.004, abs=5e-4)
