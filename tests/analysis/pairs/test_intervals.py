"""Ties by Rao and Kupper, intervals, questions and crossed effects, against likelihoods written out here."""

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize, special, stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.pairs.abilities import ItemFactors, fit_abilities
from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons, read_comparisons
from analysis.pairs.crossed import CrossedLikelihood, crossed_pairs
from analysis.pairs.intervals import compare_questions, rank_limits
from analysis.pairs.likelihood import Model, free_abilities
from experiments.errors import InputError

WORTH = np.array([0.0, 0.5, 0.9, 1.4])


def simulated(
    seed: int = 3, n: int = 600, raters: int = 25, tie: float = 0.5, spread: float = 0.0, contents: int = 1
) -> Comparisons:
    """Comparisons of four items by Rao and Kupper's model; raters and contents shift items by `spread`."""
    random = np.random.default_rng(seed)
    rater, content = np.arange(n) % raters, random.integers(contents, size=n)
    own, of_content = (spread * random.normal(size=(size, 4)) for size in (raters, contents))
    left = random.integers(4, size=n)
    right = (left + random.integers(1, 4, size=n)) % 4
    shown = [WORTH[side] + own[rater, side] + of_content[content, side] for side in (left, right)]
    eta = shown[0] - shown[1]
    wins, losses = special.expit(eta - tie), special.expit(-eta - tie)
    drawn = random.random(n)
    outcome = np.where(drawn < wins, LEFT, np.where(drawn < wins + losses, RIGHT, TIE))
    names = tuple(f"r{k:03d}" for k in range(raters))
    content_names = np.array([f"s{k}" for k in content])
    return Comparisons(tuple("abcd"), left, right, outcome, rater, names, "made", True, (), content_names)


def log_likelihood(own: Comparisons, worth: np.ndarray, tau: float) -> float:
    """Rao and Kupper's, item by item from their paper's form with theta = e^tau."""
    pi, theta = np.exp(worth), np.exp(tau)
    one, other = pi[own.left], pi[own.right]
    wins, losses = one / (one + theta * other), other / (theta * one + other)
    p = np.stack([wins, losses, 1 - wins - losses])[own.outcome, np.arange(own.outcome.size)]
    return float(np.log(p).sum())


def test_rao_kupper_is_the_maximum_of_the_likelihood_of_their_paper() -> None:
    own = simulated()
    result = fit_abilities(own, "rao-kupper")
    best = optimize.minimize(
        lambda v: -log_likelihood(own, np.append(0.0, v[:3]), v[3]), [0, 0, 0, 0.5], tol=1e-10
    )
    assert result.log_likelihood == pytest.approx(-best.fun, rel=1e-10)
    assert result.log_theta is not None
    found = [*(item.ability for item in result.items[1:]), result.log_theta.estimate]
    assert found == pytest.approx(best.x, abs=2e-5)
    theta = np.exp(result.log_theta.estimate)
    assert result.tie_probability_max == pytest.approx((theta - 1) / (theta + 1))


def test_rao_kupper_of_one_pair_has_a_closed_form() -> None:
    """7, 4 and 9 of 20: two free shares, so that the model reproduces them."""
    outcome = np.repeat([LEFT, RIGHT, TIE], [7, 4, 9])
    sides = np.zeros(20, dtype=np.int64), np.ones(20, dtype=np.int64)
    own = Comparisons(("a", "b"), *sides, outcome, None, (), "made", True, ())
    result = fit_abilities(own, "rao-kupper")
    assert result.log_theta is not None
    wins, losses = special.logit(7 / 20), special.logit(4 / 20)
    assert result.items[1].ability == pytest.approx((losses - wins) / 2, rel=1e-9)
    assert result.log_theta.estimate == pytest.approx(-(wins + losses) / 2, rel=1e-9)


@pytest.mark.parametrize("method", ["rao-kupper", "bradley-terry", "thurstone", "davidson"])
def test_profile_ends_are_where_the_constrained_likelihood_has_fallen(method: str) -> None:
    """At an end 2 log L is 3.8415 lower; no other parameters do better there (KKT by scipy)."""
    own = simulated()
    if method in ("bradley-terry", "thurstone"):
        kept = own.outcome != TIE
        own = replace(
            own,
            left=own.left[kept],
            right=own.right[kept],
            outcome=own.outcome[kept],
            participant=own.participant[kept],
        )
    result = fit_abilities(own, method, intervals="profile")

    def deviance(v: np.ndarray) -> float:
        worth = np.append(0.0, v[:3])
        eta = worth[own.left] - worth[own.right]
        if method == "rao-kupper":
            return -2 * log_likelihood(own, worth, float(v[3]))
        if method == "davidson":
            z = np.stack([eta / 2, -eta / 2, np.full(eta.size, v[3])])
            return -2 * float(special.log_softmax(z, axis=0)[own.outcome, np.arange(eta.size)].sum())
        sign = np.where(own.outcome == LEFT, eta, -eta)
        return -2 * float(
            (special.log_ndtr(sign) if method == "thurstone" else special.log_expit(sign)).sum()
        )

    item, size = result.items[2], 3 + (method in ("rao-kupper", "davidson"))
    start = [*(one.ability for one in result.items[1:]), *([0.4] * (size - 3))]
    for end in (item.ci_low, item.ci_high):
        fixed = optimize.minimize(
            lambda rest, end=end: deviance(np.insert(rest, 1, end)), np.delete(start, 1), tol=1e-10
        )
        assert fixed.fun + 2 * result.log_likelihood == pytest.approx(3.841459, abs=1e-5)
    assert item.ci_low < item.ability < item.ci_high
    difference = next(c for c in result.contrasts if (c.first, c.second) == ("a", "c"))
    assert (difference.ci_low, difference.ci_high) == pytest.approx((-item.ci_high, -item.ci_low))


def test_bootstrap_of_raters_spreads_as_the_robust_error_says() -> None:
    own = simulated(raters=60, n=1800, spread=0.8)
    wald, drawn = (fit_abilities(own, intervals=kind, method="davidson") for kind in ("wald", "bootstrap"))
    for plain, item in zip(wald.items[1:], drawn.items[1:], strict=True):
        assert plain.se_robust is not None
        assert (item.ci_high - item.ci_low) / 3.92 == pytest.approx(plain.se_robust, rel=0.12)
        assert plain.se_robust > 1.3 * plain.se


def test_anytime_limits_are_robbins_mixture_of_the_robust_error() -> None:
    own = simulated(raters=40, n=1200)
    result, plain = (fit_abilities(own, "davidson", intervals=kind) for kind in ("anytime", "wald"))
    level = 0.05 / 6
    # tightest at 40 raters: the factor is the least over all mixtures, found here by minimizing it
    least = optimize.minimize_scalar(
        lambda s: np.sqrt((s + 1) / s * np.log((s + 1) / level**2)), bounds=(0.1, 200), method="bounded"
    )
    for item, other in zip(result.items[1:], plain.items[1:], strict=True):
        assert other.se_robust is not None
        assert item.ci_high - item.ability == pytest.approx(least.fun * other.se_robust, rel=1e-6)
    assert all(item.rank_low <= item.rank <= item.rank_high for item in result.items)  # type: ignore[operator]


def test_anytime_intervals_hold_at_every_look_where_wald_intervals_do_not() -> None:
    """60 studies of 10 to 100 raters, watched after every sixth: 9 wrong would have p < .004 at 5%."""
    left, right = np.array(list(combinations(range(4), 2))).T
    missed = {"anytime": 0, "wald": 0}
    for seed in range(60):
        random = np.random.default_rng(seed)
        wins = random.random((100, 6)) < special.expit(WORTH[left] - WORTH[right])
        outcome = np.where(wins, LEFT, RIGHT)
        wrong = dict.fromkeys(missed, False)
        for raters in range(10, 101, 6):
            sides = np.tile(left, raters), np.tile(right, raters)
            names = tuple(map(str, range(raters)))
            seen = Comparisons(
                tuple("abcd"),
                *sides,
                outcome[:raters].ravel(),
                np.repeat(np.arange(raters), 6),
                names,
                "made",
                True,
                (),
            )
            for kind in missed:
                try:
                    found = fit_abilities(seen, intervals=kind).contrasts
                except InputError:
                    continue
                truth = WORTH[left] - WORTH[right]
                wrong[kind] |= any(
                    not c.ci_low <= value <= c.ci_high for c, value in zip(found, truth, strict=True)
                )
        for kind, one in wrong.items():
            missed[kind] += one
    assert missed["anytime"] <= 8
    assert missed["wald"] > 30


def test_few_raters_are_not_watched() -> None:
    with pytest.raises(InputError, match="needs 10 raters or more for 4 items, got 9"):
        fit_abilities(simulated(raters=9), "davidson", intervals="anytime")


def test_ranks_that_differences_leave_open() -> None:
    """a > b for sure, a > c for sure, b and c open; and all open."""
    limits = np.array([[0.1, 1.0], [0.2, 1.0], [-0.5, 0.5]])
    assert rank_limits(3, limits) == [(1, 1), (2, 3), (2, 3)]
    assert rank_limits(3, -limits[:, ::-1]) == [(3, 3), (1, 2), (1, 2)]
    assert rank_limits(3, np.array([[-1.0, 1.0]] * 3)) == [(1, 3)] * 3


def test_questions_of_the_same_raters_are_compared_by_their_raters() -> None:
    """Answered alike twice, questions do not differ at all; of one pair the test is that of shares."""
    own = simulated()
    (pair,) = compare_questions({"nice": own, "real": own}, "davidson")
    assert pair.correlation == pytest.approx(1.0)
    assert all(abs(one.difference) < 1e-9 for one in pair.differences)
    (pair,) = compare_questions({"nice": own, "real": simulated(seed=8)}, "davidson")
    assert (pair.df, pair.df_error) == (3, 22)
    # each rater judges one pair once per question: b minus a is the logit of b's share
    random = np.random.default_rng(2)
    wins = random.random((2, 40)) < [[0.7], [0.4]]
    shares = wins.mean(axis=1)
    sides = np.zeros(40, dtype=np.int64), np.ones(40, dtype=np.int64)
    asked = {
        name: Comparisons(
            ("a", "b"),
            *sides,
            np.where(won, RIGHT, LEFT),
            np.arange(40),
            tuple(f"{k:02d}" for k in range(40)),
            "made",
            True,
            (),
        )
        for name, won in zip(("nice", "real"), wins, strict=True)
    }
    (pair,) = compare_questions(asked, "bradley-terry")
    influence = [(won - share) / (share * (1 - share)) for won, share in zip(wins, shares, strict=True)]
    apart = influence[0] - influence[1]
    t = (special.logit(shares[0]) - special.logit(shares[1])) / (apart.std() / np.sqrt(39))
    assert pair.f_value == pytest.approx(t**2, rel=1e-8)


def test_questions_with_other_items_are_refused() -> None:
    own = simulated()
    other = replace(own, items=("a", "b", "c", "e"))
    with pytest.raises(InputError, match="question 'real' has other items than 'nice'"):
        compare_questions({"nice": own, "real": other}, "davidson")


def dense_laplace(
    own: Comparisons, columns: list[tuple[np.ndarray, float]], fixed: np.ndarray, tau: float
) -> float:
    """The same likelihood with dense matrices and no blocks."""
    z = np.hstack([sd * part for part, sd in columns])
    b = np.zeros(z.shape[1])
    for _ in range(50):
        eta = fixed + z @ b
        wins, losses = special.expit(eta - tau), special.expit(-eta - tau)
        chances = np.stack([wins, losses, np.expm1(2 * tau) * wins * losses])
        slopes = np.stack([1 - wins, losses - 1, losses - wins])
        curves = np.stack(
            [wins * (1 - wins), losses * (1 - losses), wins * (1 - wins) + losses * (1 - losses)]
        )
        seen = own.outcome, np.arange(eta.size)
        hessian = np.eye(b.size) + z.T @ (curves[seen][:, None] * z)
        b = b + np.linalg.solve(hessian, z.T @ slopes[seen] - b)
    value = np.log(
        np.where(own.outcome == TIE, chances[2], np.where(own.outcome == LEFT, wins, losses))
    ).sum()
    return float(value - b @ b / 2 - np.linalg.slogdet(hessian)[1] / 2)


@pytest.mark.parametrize("contents", [1, 5])
def test_crossed_effects_are_the_maximum_of_the_laplace_likelihood(contents: int) -> None:
    own = simulated(n=260, raters=8, spread=0.7, contents=contents)
    own = own if contents > 1 else replace(own, content=None)
    result = fit_abilities(own, "rao-kupper", crossed=True)
    assert result.log_theta is not None
    worth = np.array([item.ability for item in result.items])

    def sides(codes: np.ndarray) -> np.ndarray:
        part = np.zeros((own.left.size, (codes.max() + 1) * 4))
        part[np.arange(own.left.size), codes * 4 + own.left] = 1
        part[np.arange(own.left.size), codes * 4 + own.right] = -1
        return part

    codes = [own.participant, *([np.unique(own.content, return_inverse=True)[1]] if contents > 1 else [])]
    parts = [sides(code) for code in codes]  # type: ignore[arg-type]

    def value(v: np.ndarray) -> float:
        fixed = np.append(0.0, v[:3])
        columns = list(zip(parts, v[4:], strict=True))
        return dense_laplace(own, columns, fixed[own.left] - fixed[own.right], float(v[3]))

    best = np.array([*worth[1:], result.log_theta.estimate, *(one.sd for one in result.random_effects)])
    assert [one.name for one in result.random_effects] == ["rater", "content"][: len(parts)]
    assert value(best) == pytest.approx(result.log_likelihood, abs=1e-7)
    h = 1e-3 * np.eye(best.size)
    curvature = np.array(
        [
            [
                (value(best + a + b) - value(best + a - b) - value(best - a + b) + value(best - a - b)) / 4e-6
                for b in h
            ]
            for a in h
        ]
    )
    slope = np.array([(value(best + a) - value(best - a)) / 2e-3 for a in h])
    assert np.abs(np.linalg.solve(curvature, slope)).max() < 1e-4
    errors = np.sqrt(np.diag(np.linalg.inv(-curvature)))
    assert [item.se for item in result.items[1:]] == pytest.approx(errors[:3], rel=1e-3)


def test_raters_who_never_contradict_themselves_have_no_largest_spread() -> None:
    random = np.random.default_rng(2)
    order = np.array([random.permutation(3) for _ in range(12)])
    left, right = np.tile(np.array([*combinations(range(3), 2)]), (72, 1)).T
    rater = np.repeat(np.arange(12), 18)
    outcome = np.where(order[rater, left] < order[rater, right], LEFT, RIGHT)
    names = tuple(f"r{k}" for k in range(12))
    own = Comparisons(tuple("abc"), left, right, outcome, rater, names, "made", True, ())
    with pytest.raises(InputError, match="the SD of 'rater' grows without limit"):
        fit_abilities(own, crossed=True)


def judged_once(seed: int, gap: float, repeats: int = 1, raters: int = 40) -> Comparisons:
    """Each rater compares each pair of four items; abilities lie `gap` apart, raters' own differ by 0.5."""
    random = np.random.default_rng(seed)
    pairs = np.array([*combinations(range(4), 2)] * repeats)
    left, right = np.tile(pairs, (raters, 1)).T
    rater = np.repeat(np.arange(raters), len(pairs))
    own = gap * np.arange(4) + 0.5 * random.normal(size=(raters, 4))
    wins = special.expit(own[rater, left] - own[rater, right]) > random.random(left.size)
    names = tuple(map(str, range(raters)))
    return Comparisons(
        tuple("abcd"), left, right, np.where(wins, LEFT, RIGHT), rater, names, "made", True, ()
    )


def test_a_maximum_of_the_approximation_alone_is_refused() -> None:
    """One answer per pair: in a third of such data the Laplace SD runs away, where the true one is 0.5."""
    found, refusals = [], []
    for seed in range(12):
        try:
            found.append(fit_abilities(judged_once(seed, 1.67), crossed=True).random_effects[0].sd)
        except InputError as error:
            refusals.append(str(error))
    assert 2 < len(refusals) < 8
    assert all("too few answers of each rater" in text for text in refusals)
    assert max(found) < 1.5


def test_crossed_gradient_is_that_of_the_likelihood() -> None:
    own = simulated(n=300, spread=0.7, contents=4)
    model = Model("rao-kupper", free_abilities(4), order_effect=True)
    likelihood = CrossedLikelihood(crossed_pairs(own, model, items_vary=True))
    theta = np.array([0.4, 0.8, 1.5, 0.2, 0.5, 0.6, 0.5, 0.3])
    steps = 1e-5 * np.eye(theta.size)
    numeric = [(likelihood.evaluate(theta + s)[0] - likelihood.evaluate(theta - s)[0]) / 2e-5 for s in steps]
    assert likelihood.evaluate(theta)[1] == pytest.approx(numeric, abs=2e-4)


def test_items_vary_beyond_their_factors() -> None:
    """Twelve items of two kinds that differ within kinds: the error of the kinds' difference grows."""
    random = np.random.default_rng(4)
    worth = np.repeat([0.0, 0.6], 6) + 0.8 * random.normal(size=12)
    left = random.integers(12, size=2400)
    right = (left + random.integers(1, 12, size=2400)) % 12
    outcome = np.where(random.random(2400) < special.expit(worth[left] - worth[right]), LEFT, RIGHT)
    names = tuple(f"i{k:02d}" for k in range(12))
    raters = tuple(f"r{k:02d}" for k in range(30))
    own = Comparisons(names, left, right, outcome, np.arange(2400) % 30, raters, "made", True, ())
    factors = ItemFactors(
        ("kind",), {name: ("new" if k > 5 else "base",) for k, name in enumerate(names)}, "made"
    )
    plain, crossed = (fit_abilities(own, factors=factors, crossed=kind) for kind in (False, True))
    assert [one.name for one in crossed.random_effects] == ["rater", "item"]
    assert crossed.random_effects[1].sd == pytest.approx(
        np.std(worth[:6].tolist() + (worth[6:] - 0.6).tolist()), rel=0.4
    )
    assert crossed.random_effects[1].p < 1e-6
    assert crossed.items[-1].se > 4 * plain.items[-1].se


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--crossed",), "--crossed needs two raters or more"),
        (
            ("--crossed", "--participant", "id", "--method", "thurstone"),
            "--crossed is for --method bradley-terry",
        ),
        (("--firth", "--intervals", "profile"), "--intervals profile takes no --firth"),
        (("--intervals", "bootstrap", "--bootstrap", "0"), "needs --bootstrap above 0"),
        (("--method", "elo", "--bootstrap", "1"), "--bootstrap takes 0 or at least 100 samples, got 1"),
        (("--method", "elo", "--firth"), "--method elo takes no"),
        (("--method", "rao-kupper"), "no comparison is a tie"),
        (("--intervals", "bootstrap", "--participant", "id"), "in most samples of the 3 raters"),
    ],
)
def test_what_does_not_fit_is_one_line(tmp_path: Path, options: tuple[str, ...], said: str) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text("id,left,right,winner\n1,a,b,a\n2,b,c,b\n3,c,a,c\n", encoding="utf-8")
    result = CliRunner().invoke(app, ["pairs", str(path), *options])
    assert isinstance(result.exception, InputError)
    assert said in str(result.exception)


def test_command_fits_questions_and_scenes_and_writes_their_comparison(tmp_path: Path) -> None:
    own, rows = simulated(n=400, contents=2), ["id,scene,asked,left,right,winner"]
    for k in range(400):
        a, b = own.items[own.left[k]], own.items[own.right[k]]
        winner = (a, b, "same")[own.outcome[k]]
        rows.append(f"{own.participant[k]},{own.content[k]},{'nice' if k % 3 else 'real'},{a},{b},{winner}")  # type: ignore[index]
    path, out = tmp_path / "pairs.csv", tmp_path / "pairs.json"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    base = ["pairs", str(path), "--tie", "same", "--participant", "id", "--json", str(out)]
    result = CliRunner().invoke(app, [*base, "--by", "scene", "--question", "asked"])
    assert result.exit_code == 0, result.exception
    written = json.loads(out.read_text())
    assert set(written["contents"]) == {f"{q}, {s}" for q in ("nice", "real") for s in ("all", "s0", "s1")}
    assert written["questions"][0]["df_error"] == 22
    assert "Questions, pairs" in result.stdout
    result = CliRunner().invoke(app, [*base, "--by", "scene", "--crossed"])
    assert "Crossed effects, pairs" in result.stdout
    assert [one["name"] for one in json.loads(out.read_text())["random_effects"]] == ["rater", "content"]


def test_equivalence_of_abilities_is_two_one_sided_tests_with_raters_as_clusters() -> None:
    own = simulated()
    result = fit_abilities(own, "davidson", equivalence=(-0.8, 0.6))
    alone = fit_abilities(
        replace(own, participant=None, participants=()), "davidson", equivalence=(-0.8, 0.6)
    )
    for c, plain in zip(result.contrasts, alone.contrasts, strict=True):
        sides = (c.difference + 0.8) / c.se_robust, (0.6 - c.difference) / c.se_robust  # type: ignore[operator]
        assert c.p_equivalence == pytest.approx(max(stats.t.sf(sides, 24)))
        sides = (plain.difference + 0.8) / plain.se, (0.6 - plain.difference) / plain.se
        assert plain.p_equivalence == pytest.approx(max(stats.norm.sf(sides)))
    with pytest.raises(InputError, match="expected bounds around zero"):
        fit_abilities(own, "davidson", equivalence=(0.1, 0.6))


def test_an_item_that_only_firths_penalty_keeps_finite_is_named() -> None:
    outcome = np.array([LEFT] * 4 + [LEFT, RIGHT])
    left, right = np.array([0] * 4 + [1, 1]), np.array([1, 2, 1, 2, 2, 2])
    own = Comparisons(("a", "b", "c"), left, right, outcome, None, (), "made", True, ())
    said = fit_abilities(own, firth=True).decisions
    assert said == ("a won every comparison with the others: only Firth's penalty keeps the ability finite",)


@pytest.mark.parametrize(("won", "lost"), [(6, 2), (12, 4), (1, 1), (2, 1)])
def test_profile_of_two_items_is_that_of_a_binomial(tmp_path: Path, won: int, lost: int) -> None:
    """Few comparisons: the search starts where the likelihood is flat."""
    table = tmp_path / "few.csv"
    rows = ["a,b,a"] * won + ["a,b,b"] * lost
    table.write_text("\n".join(["left,right,winner", *rows, ""]), encoding="utf-8")
    comparisons = read_comparisons(table, "left", "right", "winner")
    result = fit_abilities(comparisons, "bradley-terry", intervals="profile")
    [contrast] = result.contrasts

    def log_likelihood(logit: float) -> float:
        return float(won * special.log_expit(logit) + lost * special.log_expit(-logit))

    middle = float(np.log(won / lost))
    height = log_likelihood(middle) - stats.chi2.ppf(0.95, 1) / 2
    sides = ((middle - 20, middle), (middle, middle + 20))
    ends = [optimize.brentq(lambda one: log_likelihood(one) - height, *side) for side in sides]
    assert sorted((contrast.ci_low, contrast.ci_high)) == pytest.approx(ends, abs=1e-5)


def test_one_rater_is_too_few_to_resample(tmp_path: Path) -> None:
    table = tmp_path / "one.csv"
    rows = ["a,b,a,p", "a,b,b,p", "a,b,a,p"]
    table.write_text("\n".join(["left,right,winner,person", *rows, ""]), encoding="utf-8")
    comparisons = read_comparisons(table, "left", "right", "winner", participant="person")
    with pytest.raises(InputError, match="needs two raters or more, got 1"):
        fit_abilities(comparisons, "bradley-terry", intervals="bootstrap")
