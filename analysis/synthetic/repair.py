"""Round cell means to whole sums of ratings and correct the rounding, one or two rating points at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.targets import MeanTarget, SpreadTarget, Targets, TestTarget

# What every target would be after each possible change of one rating point, all at once.

Floats = NDArray[np.float64]


def test_value(y: Floats, contrasts: Floats) -> float:
    """Multivariate F of contrasts (cells, q) on cell means (n, cells); df q, n - q."""
    n, q = y.shape[0], contrasts.shape[1]
    z = y @ contrasts
    mean = z.mean(axis=0)
    # From products that hold the mean as well: P / (1 - P) is Hotelling's trace.
    pillai = n * float(mean @ np.linalg.solve(z.T @ z, mean))
    return float(pillai / (1 - pillai) * (n - q) / q)


def test_after_moves(y: Floats, contrasts: Floats, step: Floats) -> Floats:
    """F after each single move, (signs, n, cells); `step` holds the signed changes of a cell mean.

    A move changes one row of Z = Y C, hence Z'Z by rank two (Woodbury).
    """
    n, q = y.shape[0], contrasts.shape[1]
    z = y @ contrasts
    u = z.mean(axis=0)
    # Once for all moves: each changes it by rank two.
    inverse = np.linalg.inv(z.T @ z)
    zb, cb = z @ inverse, contrasts @ inverse
    zz, zu = np.einsum("ij,ij->i", zb, z)[:, None], (zb @ u)[:, None]
    cc, cu = np.einsum("ij,ij->i", cb, contrasts)[None, :], (cb @ u)[None, :]
    zc, uu = zb @ contrasts.T, float(u @ inverse @ u)
    e = step[:, None, None]
    xx = uu + 2 * e / n * cu + (e / n) ** 2 * cc
    zx, cx = zu + e / n * zc, cu + e / n * cc
    # Woodbury's inner matrix, 2 x 2, is inverted by hand.
    g11, g12 = zz - 1, zc + 1 / e
    lost = (cc * zx**2 - 2 * g12 * zx * cx + g11 * cx**2) / (g11 * cc - g12**2)
    pillai = n * (xx - lost)
    return np.asarray(pillai / (1 - pillai) * (n - q) / q, dtype=np.float64)


def miss(value: Floats, low: Floats | float, high: Floats | float, scale: Floats | float) -> Floats:
    """Distance outside the window in units of `scale`: squared near, linear far away."""
    distance = np.maximum(np.maximum(low - value, value - high), 0.0) / scale
    # Smooth at the window, so that near misses count little; linear far away, so that none dominates.
    return np.where(distance < 1, distance**2, 2 * distance - 1)


AIM = 0.5
"""The search aims at this inner share of every closed window, so that what it reaches has room to move."""


def _aimed(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    # An open window has no inner share: infinity less infinity is computed and not used.
    with np.errstate(invalid="ignore"):
        inner = np.where(np.isfinite(low) & np.isfinite(high), (1 - AIM) / 2 * (high - low), 0.0)
    return low + inner, high - inner


@dataclass(frozen=True)
class _Stack:
    """Targets with one weight vector each, stacked: `weights` (m, cells), windows (m, 1, 1, 1)."""

    weights: Floats = field(repr=False)
    low: Floats
    high: Floats
    scale: Floats

    @classmethod
    def of(cls, targets: "tuple[MeanTarget | SpreadTarget | TestTarget, ...]", cells: int) -> "_Stack":
        # A test of one contrast is a weight vector as well.
        rows = [t.contrasts[:, 0] if isinstance(t, TestTarget) else t.weights for t in targets]
        columns = [np.array([getattr(t, name) for t in targets]) for name in ("low", "high", "scale")]
        low, high, scale = (c.reshape(-1, 1, 1, 1) for c in columns)
        low, high = _aimed(low, high)
        return cls(np.array(rows).reshape(len(targets), cells), low, high, scale)

    def loss(self, value: Floats) -> Floats:
        return np.asarray(miss(value, self.low, self.high, self.scale).sum(axis=0))


class MoveLoss:
    """Loss of the data after every single move, for fixed targets."""

    def __init__(self, targets: Targets, cells: int) -> None:
        tests = (*targets.tests, *targets.pairs)
        self.means = _Stack.of((*targets.means, *targets.directions), cells)
        self.spreads = _Stack.of(targets.spreads, cells)
        # Tests of one contrast need no matrices, and are most of them.
        self.single = _Stack.of(tuple(t for t in tests if t.contrasts.shape[1] == 1), cells)
        self.blocks = tuple(t for t in tests if t.contrasts.shape[1] > 1)

    def after_moves(self, y: Floats, step: Floats) -> Floats:
        """Loss (signs, n, cells) after changing cell mean (person, cell) of y (n, cells) by each step."""
        loss = self._means(y, step) + self._single(y, step)
        if len(self.spreads.weights):
            loss = loss + self._spreads(y, step)
        for t in self.blocks:
            low, high = _aimed(np.array(t.low), np.array(t.high))
            loss = loss + miss(test_after_moves(y, t.contrasts, step), low, high, t.scale)
        return loss

    def _means(self, y: Floats, step: Floats) -> Floats:
        weights = self.means.weights
        now = weights @ y.mean(axis=0)
        change = weights[:, None, None, :] * step[None, :, None, None] / len(y)
        return self.means.loss(now[:, None, None, None] + change)

    def _single(self, y: Floats, step: Floats) -> Floats:
        n, weights = len(y), self.single.weights
        z = y @ weights.T
        change = weights[:, None, None, :] * step[None, :, None, None]
        mean = z.mean(axis=0)[:, None, None, None] + change / n
        # (z + c)2 - z2 = c (2 z + c), without a second pass over the data.
        squares = (z * z).sum(axis=0)[:, None, None, None] + change * (2 * z.T[:, None, :, None] + change)
        pillai = n * mean**2 / squares
        return self.single.loss(pillai / (1 - pillai) * (n - 1))

    def _spreads(self, y: Floats, step: Floats) -> Floats:
        n, weights = len(y), self.spreads.weights
        v = y @ weights.T
        v = v - v.mean(axis=0)
        change = weights[:, None, None, :] * step[None, :, None, None]
        squares = (v * v).sum(axis=0)[:, None, None, None] + change * (
            # A change of one value moves the mean, too, hence 1 - 1/n.
            2 * v.T[:, None, :, None] + change * (1 - 1 / n)
        )
        # Rounding may leave a sum of squares just below 0.
        return self.spreads.loss(np.sqrt(np.maximum(squares, 0.0) / (n - 1)))


def value_of(y: Floats, target: MeanTarget | SpreadTarget | TestTarget) -> float:
    """The statistic of a target on cell means (n, cells)."""
    if isinstance(target, MeanTarget):
        return float(target.weights @ y.mean(axis=0))
    if isinstance(target, SpreadTarget):
        return float((y @ target.weights).std(ddof=1))
    return test_value(y, target.contrasts)


Integers = NDArray[np.int64]

FIRST_MOVES = 40
"""How many random first moves are tried, each with every second move, where no single move helps."""

MAXIMUM_STEPS = 3000

STALLS = 3
"""Fruitless rounds of paired moves before random moves."""

KICK = 8
"""Random moves that leave a dead end."""


@dataclass(frozen=True)
class UnmetTarget:
    """A target that the data do not hit."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class RepairedSums:
    """Cell sums (n, cells), and the targets still missed."""

    sums: Integers = field(repr=False)
    missed: tuple[UnmetTarget, ...]
    steps: int


def missed_targets(y: Floats, targets: Targets) -> tuple[UnmetTarget, ...]:
    """Targets whose statistic on cell means (n, cells) lies outside the window."""
    missed = []
    for target in targets.everything:
        value = value_of(y, target)
        if not target.low <= value <= target.high:
            missed.append(UnmetTarget(target.name, value, target.low, target.high))
    return tuple(missed)


class _Search:
    """Whole cell sums within the scale, and the loss of every move from them."""

    def __init__(
        self, sums: Integers, trials: int, scale: tuple[int, int], targets: Targets, rng: np.random.Generator
    ) -> None:
        self.sums, self.trials, self.rng = sums, trials, rng
        self.low, self.high = trials * scale[0], trials * scale[1]
        self.loss_of = MoveLoss(targets, sums.shape[1])
        self.signs = np.array([1, -1])

    def losses(self) -> Floats:
        # Sums in the moves, means in the targets.
        loss = self.loss_of.after_moves(self.sums / self.trials, self.signs / self.trials)
        # A move off the scale is never the best.
        loss[0][self.sums >= self.high] = np.inf
        loss[1][self.sums <= self.low] = np.inf
        return loss

    def move(self, index: tuple[int, int, int], back: bool = False) -> None:
        sign, person, cell = index
        self.sums[person, cell] += -self.signs[sign] if back else self.signs[sign]

    def best(self) -> tuple[tuple[int, int, int], float]:
        loss = self.losses()
        index = np.unravel_index(int(np.argmin(loss)), loss.shape)
        return (int(index[0]), int(index[1]), int(index[2])), float(loss[index])

    def kick(self) -> None:
        """Make a few random moves, to leave a dead end."""
        for _ in range(KICK):
            person, cell = self.rng.integers(self.sums.shape[0]), self.rng.integers(self.sums.shape[1])
            self.sums[person, cell] = np.clip(
                self.sums[person, cell] + self.rng.choice(self.signs), self.low, self.high
            )

    def two_moves(self, below: float) -> float:
        """Make the best pair of moves met that brings the loss under `below`; the loss reached."""
        n, cells = self.sums.shape
        chosen, reached = None, below
        for _ in range(FIRST_MOVES):
            first = (int(self.rng.integers(2)), int(self.rng.integers(n)), int(self.rng.integers(cells)))
            # At an end of the scale a move may leave it: such ratings are passed over.
            if not self.low < self.sums[first[1], first[2]] < self.high:
                continue
            self.move(first)
            second, loss = self.best()
            # Only tried: the pair is made once all first moves are compared.
            self.move(first, back=True)
            if loss < reached:
                chosen, reached = (first, second), loss
                # Nothing can be better.
                if loss == 0:
                    break
        for index in chosen or ():
            self.move(index)
        return reached


def repair(
    cell_means: Floats,
    trials: int,
    scale: tuple[int, int],
    targets: Targets,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
    maximum_pairs: int = 60,
) -> RepairedSums:
    """Find whole sums of `trials` ratings near `cell_means` (n, cells) that hit every target.

    Steepest descent over all changes of one point; where none helps, over random pairs of changes; from a
    dead end a few random ones lead on. Ends when every target is hit or after `maximum_pairs` rounds of
    paired changes. `progress` gets (targets missed, step).
    """
    # The nearest whole sums, which miss most figures by a little.
    sums = np.clip(np.rint(cell_means * trials), trials * scale[0], trials * scale[1]).astype(np.int64)
    search = _Search(sums, trials, scale, targets, rng)
    now, stalled, paired, step = np.inf, 0, 0, 0
    missed = missed_targets(sums / trials, targets)
    while missed and paired < maximum_pairs and step < MAXIMUM_STEPS:
        step += 1
        index, loss = search.best()
        # Strictly less, or two equal moves would follow each other for ever.
        if loss < now:
            search.move(index)
            now = loss
        else:
            paired += 1
            before, now = now, search.two_moves(now)
            stalled = stalled + 1 if now == before else 0
            if stalled == STALLS:
                search.kick()
                # After a kick every loss is progress, else the search would go straight back.
                now, stalled = np.inf, 0
        missed = missed_targets(search.sums / trials, targets)
        if progress is not None:
            progress(len(missed), step)
    return RepairedSums(search.sums, missed, step)
