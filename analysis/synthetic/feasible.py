"""Whether printed means can hold together for complete data, and which figure gives way where they cannot."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from analysis.synthetic.published import MarginLevels, PrintedMean, Published, decimals, window
from analysis.synthetic.space import DesignSpace
from analysis.synthetic.targets import place_name
from experiments.errors import InputError


@dataclass(frozen=True)
class GivenWay:
    """A printed mean that cannot hold beside the others, and the nearest one that can."""

    at: MarginLevels
    printed: str
    used: str
    reason: str

    def __str__(self) -> str:
        return f"{place_name(self.at)}: printed {self.printed} is impossible, made {self.used}; {self.reason}"


def make_feasible(published: Published, space: DesignSpace) -> tuple[Published, tuple[GivenWay, ...]]:
    """Return figures whose means can all hold, changing one printed mean by one last digit where they cannot.

    Averaged over all levels, every factor of complete data gives the same grand mean, so printed means of
    several factors constrain each other. `gives_way` of the figures names the mean to change first.
    Raises InputError where no single change helps.
    """
    if _possible(published.means, space):
        return published, ()
    reason = _contradiction(published.means, space)
    order = sorted(range(len(published.means)), key=lambda i: published.means[i].at != published.gives_way)
    for position in order:
        for sign in (-1, 1):
            changed = _nudged(published.means, position, sign)
            if _possible(changed, space):
                old = published.means[position]
                given = GivenWay(old.at, old.printed, changed[position].printed, reason)
                return published.model_copy(update={"means": changed}), (given,)
    raise InputError(f"the wanted means contradict each other: {reason}; change one of them")


def _nudged(means: tuple[PrintedMean, ...], position: int, sign: int) -> tuple[PrintedMean, ...]:
    old = means[position]
    digits = decimals(old.printed)
    new = PrintedMean(at=old.at, printed=f"{float(old.printed) + sign * 10.0**-digits:.{digits}f}")
    return (*means[:position], new, *means[position + 1 :])


def _possible(means: tuple[PrintedMean, ...], space: DesignSpace) -> bool:
    """Whether some cell means lie strictly inside every window (linear programme for the largest slack)."""
    if not means:
        return True
    rows = np.stack([space.weights(m.at) for m in means])
    low, high = np.array([window(m.printed) for m in means]).T
    half = (high - low)[:, None] / 2
    bounds = [(None, None)] * space.n_cells + [(None, 1.0)]
    solution = linprog(
        np.r_[np.zeros(space.n_cells), -1.0],
        A_ub=np.vstack([np.hstack([rows, half]), np.hstack([-rows, half])]),
        b_ub=np.r_[high, -low],
        bounds=bounds,
    )
    return bool(solution.x is not None and solution.status == 0 and solution.x[-1] > 1e-6)


def _contradiction(means: tuple[PrintedMean, ...], space: DesignSpace) -> str:
    """The two factors whose printed means put the grand mean into windows that do not meet."""
    windows = {}
    for factor in space.factors:
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
