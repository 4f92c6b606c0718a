"""Wanted figures as statistics of the cell means with the window each must fall into."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise, product

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import linprog

from analysis.synthetic.published import (
    DesignSpace,
    Direction,
    MarginLevels,
    PrintedMean,
    PrintedPairs,
    PrintedTest,
    PublishedFigures,
    decimals,
    window,
)
from experiments.declaration.trial import RatedScale
from experiments.errors import InputError

Floats = NDArray[np.float64]

SAFETY = 0.9
"""A printed figure's window is narrowed to this share, so that no reader's rounding differs from ours."""


@dataclass(frozen=True)
class MeanTarget:
    """A weighted mean of cell means within [low, high]; `scale` is the distance that counts as one."""

    name: str
    weights: Floats = field(repr=False)
    low: float
    high: float
    scale: float


@dataclass(frozen=True)
class SpreadTarget:
    """The participants' SD of a marginal mean within [low, high]."""

    name: str
    weights: Floats = field(repr=False)
    low: float
    high: float
    scale: float


@dataclass(frozen=True)
class TestTarget:
    """The multivariate F (df q, N - q) of contrasts (cells, q) within [low, high]."""

    name: str
    contrasts: Floats = field(repr=False)
    low: float
    high: float
    scale: float
    start: float | None
    """The F to start from; None where only a bound on p is known."""


@dataclass(frozen=True)
class Targets:
    """All targets of one data set with `n` participants."""

    n: int
    means: tuple[MeanTarget, ...]
    spreads: tuple[SpreadTarget, ...]
    tests: tuple[TestTarget, ...]
    pairs: tuple[TestTarget, ...]
    directions: tuple[MeanTarget, ...]

    @property
    def everything(self) -> tuple[MeanTarget | SpreadTarget | TestTarget, ...]:
        """Every target, in the order above."""
        return (*self.means, *self.spreads, *self.tests, *self.pairs, *self.directions)


def place_name(at: dict[str, str]) -> str:
    """A place in words: `blur=MB amplitude=FC`."""
    return " ".join(f"{factor}={level}" for factor, level in at.items())


def narrowed(printed: str) -> tuple[float, float, float]:
    """Window of a two-sided printed figure, narrowed by SAFETY, and its half width."""
    low, high = window(printed)
    middle, half = (low + high) / 2, (high - low) / 2
    return middle - SAFETY * half, middle + SAFETY * half, half


def make_targets(published: PublishedFigures, space: DesignSpace, n: int) -> Targets:
    """Every figure of `published` as a target for `n` participants."""
    means = tuple(
        MeanTarget(f"mean {place_name(m.at)}", space.weights(m.at), *narrowed(m.printed))
        for m in published.means
    )
    spreads = []
    for s in published.spreads:
        # Targets are SDs; a standard error times the root of n is one.
        factor = np.sqrt(n) if s.kind == "se" else 1.0
        low, high, half = (float(v * factor) for v in narrowed(s.printed))
        spreads.append(
            SpreadTarget(f"participants' SD at {place_name(s.at)}", space.weights(s.at), low, high, half)
        )
    tests = tuple(test_target(t, space, n) for t in published.tests)
    pairs = tuple(target for p in published.pairs for target in _pair_targets(p, space, n))
    directions = tuple(target for d in published.directions for target in _direction_targets(d, space))
    return Targets(n, means, tuple(spreads), tests, pairs, directions)


def test_target(test: PrintedTest, space: DesignSpace, n: int) -> TestTarget:
    """The F window of an effect from its printed F and p."""
    effect = space.effect_called(test.effect)
    contrasts = space.effects[effect]
    q = contrasts.shape[1]
    # Every F is allowed until p or F narrow it.
    low, high, scale = 0.0, np.inf, 1.0
    if test.p is not None:
        # A small p is a large F: the bounds change places.
        p_low, p_high = window(test.p)
        # A little inside the bounds, so that p rounds as printed in spite of its last digits.
        low = float(stats.f.isf(min(p_high, 1.0), q, n - q)) * (1 + 1e-4)
        high = float(stats.f.isf(p_low, q, n - q)) * (1 - 1e-4) if p_low > 0 else np.inf
        scale = 0.1
    if test.f is not None:
        f_low, f_high, scale = narrowed(test.f)
        # F and p are both printed: both windows must hold.
        low, high = max(low, f_low), min(high, f_high)
    start = (low + high) / 2 if test.f is not None else None
    return TestTarget(f"F {effect}", contrasts, low, high, scale, start)


def _pair_targets(pairs: PrintedPairs, space: DesignSpace, n: int) -> Iterator[TestTarget]:
    names = space.levels_of(pairs.factor)
    everything = list(combinations(names, 2))
    # Bonferroni: the level is divided by the number of pairs, those named as exceptions included.
    limit = float(stats.f.isf(pairs.all_significant_below / len(everything), 1, n - 1))
    spared = {frozenset(pair) for pair in pairs.exceptions}
    for a, b in everything:
        contrast = space.weights({pairs.factor: a}) - space.weights({pairs.factor: b})
        # 2 % away from the limit, so that no rounding puts a pair on the wrong side.
        low, high = (0.0, limit / 1.02) if frozenset((a, b)) in spared else (limit * 1.02, np.inf)
        yield TestTarget(f"pair {pairs.factor} {a} - {b}", contrast[:, None], low, high, 0.1, None)


def _direction_targets(direction: Direction, space: DesignSpace) -> Iterator[MeanTarget]:
    for higher, lower in _ordered_places(direction, space):
        weights = space.weights(higher) - space.weights(lower)
        name = f"{place_name(higher)} above {place_name(lower)}"
        # A difference below 0.005 would print as 0.00.
        yield MeanTarget(name, weights, 0.006, np.inf, 0.005)


def _ordered_places(
    direction: Direction, space: DesignSpace
) -> Iterator[tuple[dict[str, str], dict[str, str]]]:
    if direction.higher is not None and direction.lower is not None:
        yield direction.higher, direction.lower
    # Within each level of another factor, where one is named, otherwise in the margin.
    for factor, order in (direction.order or {}).items():
        outer = (
            [{direction.within: name} for name in space.levels_of(direction.within)]
            if direction.within
            else [{}]
        )
        for at in outer:
            for a, b in pairwise(order):
                yield {**at, factor: a}, {**at, factor: b}
    if direction.highest is not None:
        # Without `vary` the place is compared with every other combination of its factors.
        varied = [direction.vary] if direction.vary else list(direction.highest)
        for names in product(*[space.levels_of(factor) for factor in varied]):
            other = {**direction.highest, **dict(zip(varied, names, strict=True))}
            if other != direction.highest:
                yield direction.highest, other


# Ratings counted in the steps of their scale, so that sums of ratings are whole numbers.


@dataclass(frozen=True)
class Steps:
    """Rating r = offset + size k, with k a whole number from `low` to `high`."""

    offset: float
    size: float
    low: int
    high: int

    @classmethod
    def of(cls, scale: RatedScale) -> "Steps":
        """The steps of a scale; without an offset where its lowest rating is a whole number of steps."""
        lowest = scale.minimum / scale.step
        # A scale from 1 to 7 in steps of 1 counts from 0; one from 0.5 in steps of 1 cannot.
        offset = 0.0 if abs(lowest - round(lowest)) < 1e-9 else scale.minimum
        low = round((scale.minimum - offset) / scale.step)
        return cls(offset, scale.step, low, low + round((scale.maximum - scale.minimum) / scale.step))

    def rating(self, k: int) -> float:
        """The rating of a whole number of steps, a whole number as one."""
        value = self.offset + self.size * k
        return int(value) if float(value).is_integer() else round(value, 6)

    def targets(self, targets: Targets) -> Targets:
        """The same targets for ratings counted in steps; tests do not depend on the unit."""
        # Most scales: nothing to convert.
        if (self.offset, self.size) == (0.0, 1.0):
            return targets
        return replace(
            targets,
            means=tuple(self._mean(target, self.offset) for target in targets.means),
            spreads=tuple(
                replace(s, low=s.low / self.size, high=s.high / self.size, scale=s.scale / self.size)
                for s in targets.spreads
            ),
            # Differences of means: an offset cancels.
            directions=tuple(self._mean(target, 0.0) for target in targets.directions),
        )

    def _mean(self, target: MeanTarget, offset: float) -> MeanTarget:
        low, high = (target.low - offset) / self.size, (target.high - offset) / self.size
        return replace(target, low=low, high=high, scale=target.scale / self.size)


# Whether printed means can hold together for complete data, and which figure gives way where they cannot.


@dataclass(frozen=True)
class GivenWay:
    """A printed mean that contradicts the others, and the nearest one that does not."""

    at: MarginLevels
    printed: str
    used: str
    reason: str

    def __str__(self) -> str:
        return f"{place_name(self.at)}: printed {self.printed} is impossible, made {self.used}; {self.reason}"


def make_feasible(
    published: PublishedFigures, space: DesignSpace
) -> tuple[PublishedFigures, tuple[GivenWay, ...]]:
    """Return figures whose means can all hold, changing one printed mean by one last digit where they cannot.

    Averaged over all levels, every factor of complete data gives the same grand mean, so printed means of
    several factors constrain each other. `gives_way` of the figures names the mean to change first.
    Raises InputError where no single change helps.
    """
    if _possible(published.means, space):
        return published, ()
    reason = _contradiction(published.means, space)
    # False sorts before True: the mean that is named to give way comes first.
    order = sorted(range(len(published.means)), key=lambda i: published.means[i].at != published.gives_way)
    for position in order:
        # One last digit: a change that a misprint or a rounding can explain.
        for sign in (-1, 1):
            changed = _nudged(published.means, position, sign)
            if _possible(changed, space):
                old = published.means[position]
                given = GivenWay(old.at, old.printed, changed[position].printed, reason)
                return published.model_copy(update={"means": changed}), (given,)
    raise InputError(f"the target means contradict each other: {reason}; change one of them")


def _nudged(means: tuple[PrintedMean, ...], position: int, sign: int) -> tuple[PrintedMean, ...]:
    old = means[position]
    digits = decimals(old.printed)
    new = PrintedMean(at=old.at, printed=f"{float(old.printed) + sign * 10.0**-digits:.{digits}f}")
    return (*means[:position], new, *means[position + 1 :])


def _possible(means: tuple[PrintedMean, ...], space: DesignSpace) -> bool:
    """Whether some cell means lie strictly inside every window (linear program for the largest slack)."""
    if not means:
        return True
    # Unknowns are the cell means and, last, the slack, which is maximized (minus 1 in the goal).
    rows = np.stack([space.weights(m.at) for m in means])
    low, high = np.array([window(m.printed) for m in means]).T
    half = (high - low)[:, None] / 2
    # At a slack of 1 every mean lies in the middle of its window: more is not possible.
    bounds = [(None, None)] * space.n_cells + [(None, 1.0)]
    solution = linprog(
        np.r_[np.zeros(space.n_cells), -1.0],
        # Each mean plus and minus slack times half its window must stay inside the window.
        A_ub=np.vstack([np.hstack([rows, half]), np.hstack([-rows, half])]),
        b_ub=np.r_[high, -low],
        bounds=bounds,
    )
    return bool(solution.x is not None and solution.status == 0 and solution.x[-1] > 1e-6)


def _contradiction(means: tuple[PrintedMean, ...], space: DesignSpace) -> str:
    """The two factors whose printed means put the grand mean into windows that do not meet."""
    windows = {}
    for factor in space.factors:
        # Only a factor with all of its means printed fixes the grand mean.
        mine = {m.at[factor]: window(m.printed) for m in means if set(m.at) == {factor}}
        if len(mine) == len(space.levels_of(factor)):
            windows[factor] = tuple(float(np.mean([w[side] for w in mine.values()])) for side in (0, 1))
    if len(windows) < 2:
        return "no cell means satisfy them all"
    high = max(windows, key=lambda f: windows[f][0])
    low = min(windows, key=lambda f: windows[f][1])
    return (
        f"'{high}' needs a grand mean of at least {windows[high][0]:.4f}, "
        f"'{low}' one below {windows[low][1]:.4f}, and complete data have one grand mean"
    )
