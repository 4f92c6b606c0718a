"""What a paper's printed figures say about themselves: df, p, errors, and whether all can hold at once."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import combinations, product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.optimize import linprog

from analysis.paper.printed import PrintedInterval, PrintedMean, PrintedPaper, PrintedStudy, PrintedTest
from analysis.report.numbers import fixed, p_value

# Whether printed means of margins and cells can hold at once in a balanced design.

Floats = NDArray[np.float64]
_SLACK = 1e-9
"""Room, in rating points, below which only the excluded upper ends of rounding intervals would fit."""


def joint_findings(
    study: PrintedStudy,
) -> Iterator[tuple[Literal["impossible"], str, str]]:
    """(kind, about, why) for sets of printed means that no complete balanced data can have."""
    # In unbalanced data margins weigh cells by how many trials these have.
    if not study.balanced or len(study.mean) < 2 or possible(study, study.mean):
        return
    clash = _smallest_clash(study)
    about = ", ".join(f"{mean.name} {mean.mean}" for mean in clash)
    yield "impossible", about, f"{_in_words(study, clash)}{_repairs(study, clash)}, or trials are missing"


def possible(study: PrintedStudy, means: Sequence[PrintedMean]) -> bool:
    """Whether cell means exist whose margins round to every printed mean (upper ends excluded).

    A linear program over the cell means: the room t left above every lower and below every upper end
    is maximized; the figures are possible where t is positive.
    """
    cells = list(product(*study.factors.values()))
    weights = np.array([_weights(study, mean, cells) for mean in means])
    rounded = [PrintedInterval.of(mean.mean) for mean in means]
    low, high = np.array([float(r.low) for r in rounded]), np.array([float(r.high) for r in rounded])
    room = np.ones((len(means), 1))
    # Room below the upper end alone: the lower end itself rounds to the figure.
    upper = np.hstack([weights, room])
    lower = np.hstack([-weights, np.zeros_like(room)])
    # Cell means lie on the scale; the room at most 1, so that the program has a maximum.
    bounds = [study.scale or (None, None)] * len(cells) + [(None, 1.0)]
    solved = linprog(
        # linprog minimizes, hence minus the room.
        np.r_[np.zeros(len(cells)), -1.0],
        A_ub=np.vstack([upper, lower]),
        b_ub=np.r_[high, -low],
        bounds=bounds,
        method="highs",
    )
    return solved.x is not None and bool(solved.x[-1] > _SLACK)


def _weights(study: PrintedStudy, mean: PrintedMean, cells: list[tuple[str, ...]]) -> Floats:
    """Weights of the cells in a mean: the cells it covers, equally."""
    names = list(study.factors)
    inside = np.array(
        [all(cell[names.index(factor)] == level for factor, level in mean.at.items()) for cell in cells]
    )
    return np.asarray(inside / inside.sum(), dtype=np.float64)


def _smallest_clash(study: PrintedStudy) -> list[PrintedMean]:
    """Leave out means one by one as long as the rest still clashes: what is left all takes part."""
    clash = list(study.mean)
    # One pass is enough: leaving out more never makes possible means clash.
    for mean in list(study.mean):
        rest = [other for other in clash if other is not mean]
        if len(rest) > 1 and not possible(study, rest):
            clash = rest
    return clash


def _in_words(study: PrintedStudy, clash: list[PrintedMean]) -> str:
    """The clash as sums where it is between the levels of factors, else in general terms."""
    sums = []
    for factor, levels in study.factors.items():
        parts = [m for level in levels for m in clash if m.at == {factor: level}]
        if len(parts) == len(levels):
            # Decimals: a sum of rounded figures in binary may miss an end by its last bit.
            low = sum((PrintedInterval.of(m.mean).low for m in parts), Decimal(0))
            high = sum((PrintedInterval.of(m.mean).high for m in parts), Decimal(0))
            names = " + ".join(m.name for m in parts)
            sums.append((len(parts), f"{low} <= {names} < {high}"))
    # Words of sums would not explain a clash that is mostly about cells.
    if len(sums) * 2 < len(clash) or len(sums) < 2:
        return "these means cannot all hold in complete, balanced data"
    same = len({count for count, _ in sums}) == 1
    rule = (
        f"both equal {sums[0][0]} times the grand mean" if same else "each is its levels times the grand mean"
    )
    return f"{' but '.join(text for _, text in sums)}, and {rule} in complete, balanced data"


def _repairs(study: PrintedStudy, clash: list[PrintedMean]) -> str:
    """Which single figure, one unit off in its last digit, would make everything possible."""
    healed = []
    for mean in clash:
        unit = PrintedInterval.of(mean.mean).unit
        # One unit in either direction: a misprint or a wrong rounding.
        for step in (-unit, unit):
            changed = mean.model_copy(update={"mean": str(Decimal(mean.mean) + step)})
            others = [changed if other is mean else other for other in study.mean]
            if possible(study, others):
                healed.append(f"{changed.name} {changed.mean}")
    return (
        (f". One figure may be off by one in its last digit ({' or '.join(healed)} would fit)")
        if healed
        else ""
    )


Kind = Literal["impossible", "contradiction", "doubt", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing found: which study, how grave, in which check, about what, and why."""

    study: str
    kind: Kind
    check: str
    about: str
    why: str


def check_paper(paper: PrintedPaper) -> tuple[Finding, ...]:
    """Run every check on every study; notes report correct results where they are informative."""
    return tuple(finding for study in paper.study for finding in check_study(study))


def check_study(study: PrintedStudy) -> Iterator[Finding]:
    """Every check on one study."""
    yield from _degrees_of_freedom(study)
    yield from _p_values(study)
    yield from _printed_twice(study)
    yield from _errors(study)
    for kind, about, why in joint_findings(study):
        yield Finding(study.name, kind, "joint means", about, why)
    yield from _correlations(study)
    yield from _correction(study)


def forms(study: PrintedStudy, effect: str) -> dict[str, tuple[int, int]]:
    """The df an effect has as a multivariate and as a univariate test."""
    q, n = study.contrasts(effect), study.participants
    # Hotelling's test has N - q error df; the univariate one q times N - 1.
    return {"multivariate": (q, n - q), "univariate": (q, q * (n - 1))}


def _degrees_of_freedom(study: PrintedStudy) -> Iterator[Finding]:
    """Multivariate (q, N - q) or univariate (q, q (N - 1)); with one contrast the two are one."""
    by_form: dict[str, list[PrintedTest]] = {"multivariate": [], "univariate": []}
    for test in study.test:
        if test.df is None:
            continue
        both = forms(study, test.effect)
        if test.df not in both.values():
            why = (
                f"N = {study.participants} gives {both['multivariate']} (multivariate) or "
                f"{both['univariate']} (univariate), not {test.df}"
            )
            yield Finding(study.name, "contradiction", "df", test.name, why)
        # With one contrast both forms have the same df and say nothing of the form.
        elif both["multivariate"] != both["univariate"]:
            by_form["multivariate" if test.df == both["multivariate"] else "univariate"].append(test)
    for form, tests in by_form.items():
        if tests:
            yield _form(study, form, tests)
    # Some tests of each form: a paper usually reports one.
    if all(by_form.values()):
        names = ", ".join(test.name for test in by_form["univariate"])
        yield Finding(study.name, "doubt", "df", names, "univariate among multivariate tests")


def _form(study: PrintedStudy, form: str, tests: list[PrintedTest]) -> Finding:
    other = "univariate" if form == "multivariate" else "multivariate"
    would = "; ".join(f"{test.effect} {forms(study, test.effect)[other]}" for test in tests)
    rule = "(q, N - q)" if form == "multivariate" else "(q, q (N - 1))"
    why = f"all df are {rule}: the tests are {form}. {other.capitalize()} df would be {would}"
    return Finding(study.name, "note", "df", ", ".join(test.effect for test in tests), why)


def _p_values(study: PrintedStudy) -> Iterator[Finding]:
    for test in study.test:
        if test.p is None:
            continue
        # Without printed df, both forms are tried.
        given = [test.df] if test.df else sorted(set(forms(study, test.effect).values()))
        if not any(_p_fits(test, df) for df in given):
            truth = ", ".join(f"{p_value(_p(float(test.f), df))} on {df}" for df in given)
            why = f"printed p {_said(test.p)}, but this F gives p = {truth}"
            yield Finding(study.name, "contradiction", "p", test.name, why)


def _p(f: float, df: tuple[int, int]) -> float:
    return float(special.fdtrc(df[0], df[1], max(f, 0.0)))


def _said(p: str) -> str:
    return p if p[0] in "<>" else f"= {p}"


def _p_fits(test: PrintedTest, df: tuple[int, int]) -> bool:
    """Whether some F that rounds to the printed one has a p that rounds (or is cut) to the printed one."""
    f = PrintedInterval.of(test.f)
    # A larger F has a smaller p, so the ends change places.
    least, greatest = _p(float(f.high), df), _p(float(f.low), df)
    p = test.p or ""
    if p.startswith("<"):
        return least < float(p[1:])
    if p.startswith(">"):
        return greatest > float(p[1:])
    # An interval, since p may be rounded or cut in print.
    printed = PrintedInterval.of(p)
    return least < float(printed.high) and greatest >= float(printed.low)


def _printed_twice(study: PrintedStudy) -> Iterator[Finding]:
    """The same F in two places: equal after rounding, cut instead of rounded, or different."""
    for one, other in combinations(study.test, 2):
        if one.effect != other.effect or one.f == other.f:
            continue
        # The one with fewer decimals first.
        coarse, fine = sorted((PrintedInterval.of(one.f), PrintedInterval.of(other.f)), key=lambda r: -r.unit)
        if coarse.low < fine.high and fine.low < coarse.high:
            continue
        about = f"{one.name} and {other.name}"
        right = fine.printed.quantize(coarse.unit)
        # Cut off, not rounded: a slip rather than another value.
        if coarse.cut(fine.printed) == coarse.printed:
            why = f"{fine.printed} rounds to {right}; {coarse.printed} is cut off, not rounded"
            yield Finding(study.name, "contradiction", "printed twice", about, why)
        else:
            yield Finding(study.name, "contradiction", "printed twice", about, "two different values")


def _errors(study: PrintedStudy) -> Iterator[Finding]:
    """Whether an error called SE can be one: participants' means of ratings have a largest possible SD."""
    if study.scale is None:
        return
    # Only what is called an SE: an SD of this size may be right.
    wrong = [mean for mean in study.mean if mean.error_name == "SE" and _too_large(study, mean)]
    for mean in wrong:
        spread = float(Decimal(mean.error or "0")) * math.sqrt(study.participants)
        largest = _largest_sd(study, float(mean.mean))
        true = float(Decimal(mean.error or "0")) / math.sqrt(study.participants)
        why = (
            f"as an SE, {mean.error} means an SD of {fixed(spread)} over {study.participants} participants; "
            f"ratings from {study.scale[0]:g} to {study.scale[1]:g} with mean {mean.mean} allow at most "
            f"{fixed(largest)}. It is an SD; the SE is {fixed(true)}"
        )
        about = f"{mean.name} {mean.mean} ({mean.error})" + (f" [{mean.where}]" if mean.where else "")
        yield Finding(study.name, "impossible", "SE or SD", about, why)


def _too_large(study: PrintedStudy, mean: PrintedMean) -> bool:
    if mean.error is None:
        return False
    # From the lower end of the rounding: what is refused is refused for every value.
    least = float(PrintedInterval.of(mean.error).low) * math.sqrt(study.participants)
    return least > _largest_sd(study, float(mean.mean))


def _largest_sd(study: PrintedStudy, mean: float) -> float:
    """SD of N values on a scale with this mean, if all sat at its ends (Bhatia & Davis 2000)."""
    low, high = study.scale or (mean, mean)
    n = study.participants
    # A mean off the scale leaves no room for a spread.
    return math.sqrt(max(0.0, (mean - low) * (high - mean)) * n / (n - 1))


def _correlations(study: PrintedStudy) -> Iterator[Finding]:
    """Correlation of a two-level factor's conditions, implied by their means, SEs and F."""
    for factor, levels in study.factors.items():
        means = [m for level in levels for m in study.mean if m.at == {factor: level} and m.error]
        test = next((t for t in study.test if t.effect == factor), None)
        if len(levels) != 2 or len(means) != 2 or test is None or float(test.f) <= 0:
            continue
        first, second = (float(m.error or 0) for m in means)
        # F is the square of the t of the difference, so that this is its standard error.
        difference = (float(means[0].mean) - float(means[1].mean)) / math.sqrt(float(test.f))
        # An SE printed as 0 says nothing of a correlation.
        if not first * second:
            continue
        # Variance of a difference: a2 + b2 - 2 r a b, solved for r.
        r = (first**2 + second**2 - difference**2) / (2 * first * second)
        about = f"{factor} F = {test.f}"
        if abs(r) > 1 + _slack(means, test):
            why = f"means, SEs and F imply a correlation of {fixed(r)} between the conditions"
            yield Finding(study.name, "impossible", "correlation", about, why)
        else:
            why = f"means, SEs and F imply a correlation of {fixed(r)} between the two conditions"
            yield Finding(study.name, "note", "correlation", about, why)


def _slack(means: list[PrintedMean], test: PrintedTest) -> float:
    """How far rounding of SEs and means may carry the implied correlation, to first order."""
    a, b = (float(m.error or 0) for m in means)
    unit = max(float(PrintedInterval.of(m.error or "0").unit) for m in means)
    rough = float(PrintedInterval.of(means[0].mean).unit) / math.sqrt(float(test.f))
    difference = abs(float(means[0].mean) - float(means[1].mean)) / math.sqrt(float(test.f))
    return unit * (a + b) / (a * b) + 2 * rough * (difference + rough) / (a * b)


def _correction(study: PrintedStudy) -> Iterator[Finding]:
    """Which printed F tests a Bonferroni correction over all of them would not leave significant."""
    if study.corrected is None:
        return
    m = study.corrected.tests
    # A test printed twice counts once.
    for test in {t.effect: t for t in study.test}.values():
        df = test.df or forms(study, test.effect)["multivariate"]
        p = _p(float(test.f), df)
        # Only where the correction would change the verdict.
        if p < 0.05 <= min(1.0, m * p):
            why = (
                f"p = {p_value(p)}; corrected over {m} tests it would be {p_value(min(1.0, m * p))}, so the "
                "correction applies to the pairs, not to the F tests"
            )
            yield Finding(study.name, "note", "correction", test.name, why)
