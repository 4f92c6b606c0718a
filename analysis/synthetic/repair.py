"""Round cell means to whole sums of ratings and mend the rounding, one or two rating points at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.moves import MoveLoss, value_of
from analysis.synthetic.targets import Targets

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

FIRST_MOVES = 40
"""How many random first moves are tried, each with every second move, where no single move helps."""

MAXIMUM_STEPS = 3000

STALLS = 3
"""Fruitless rounds of paired moves before random moves."""

KICK = 8
"""Random moves that leave a dead end."""


@dataclass(frozen=True)
class Missed:
    """A target that the data do not hit."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Repaired:
    """Cell sums (n, cells), and the targets still missed."""

    sums: Integers = field(repr=False)
    missed: tuple[Missed, ...]
    steps: int


def missed_targets(y: Floats, targets: Targets) -> tuple[Missed, ...]:
    """Targets whose statistic on cell means (n, cells) lies outside the window."""
    missed = []
    for target in targets.everything:
        value = value_of(y, target)
        if not target.low <= value <= target.high:
            missed.append(Missed(target.name, value, target.low, target.high))
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
        loss = self.loss_of.after_moves(self.sums / self.trials, self.signs / self.trials)
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
            if not self.low < self.sums[first[1], first[2]] < self.high:
                continue
            self.move(first)
            second, loss = self.best()
            self.move(first, back=True)
            if loss < reached:
                chosen, reached = (first, second), loss
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
) -> Repaired:
    """Find whole sums of `trials` ratings near `cell_means` (n, cells) that hit every target.

    Steepest descent over all changes of one point; where none helps, over random pairs of changes; from a
    dead end a few random ones lead on. Ends when every target is hit or after `maximum_pairs` rounds of
    paired changes. `progress` gets (targets missed, step).
    """
    sums = np.clip(np.rint(cell_means * trials), trials * scale[0], trials * scale[1]).astype(np.int64)
    search = _Search(sums, trials, scale, targets, rng)
    now, stalled, paired, step = np.inf, 0, 0, 0
    missed = missed_targets(sums / trials, targets)
    while missed and paired < maximum_pairs and step < MAXIMUM_STEPS:
        step += 1
        index, loss = search.best()
        if loss < now:
            search.move(index)
            now = loss
        else:
            paired += 1
            before, now = now, search.two_moves(now)
            stalled = stalled + 1 if now == before else 0
            if stalled == STALLS:
                search.kick()
                now, stalled = np.inf, 0
        missed = missed_targets(search.sums / trials, targets)
        if progress is not None:
            progress(len(missed), step)
    return Repaired(search.sums, missed, step)
