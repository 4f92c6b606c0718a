"""Power of any design that can draw a data set and test it, and what a plan says of its sample size."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from analysis.power.simulate import PowerResult
from experiments.errors import InputError


class Design(Protocol):
    """A population, and the tests of one data set drawn from it."""

    @property
    def effects(self) -> tuple[str, ...]:
        """What is tested."""

    @property
    def test(self) -> str:
        """The test, in a few words."""

    @property
    def population(self) -> str:
        """The population in a sentence for a plan, without its full stop."""

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of each effect in one data set of n participants; NaN where the data allow no test."""


def simulate_design(
    design: Design,
    name: str,
    sizes: Sequence[int],
    simulations: int = 500,
    alpha: float = 0.05,
    seed: int = 1,
    progress: Callable[[int], None] | None = None,
) -> PowerResult:
    """Share of data sets with p below alpha, for every effect and sample size.

    Parameters
    ----------
    design : Design
    name : str
        What the result is called.
    sizes : sequence of int
        Numbers of participants.
    simulations : int
        Data sets a size.
    alpha : float
        Level of the tests.
    seed : int
        The same seed gives the same numbers.
    progress : callable, optional
        Gets the number of data sets just finished.

    Returns
    -------
    PowerResult
        A data set that allows no test counts as one without a finding; where none allows it power is NaN.

    Raises
    ------
    InputError
        Alpha outside 0 to 1, fewer than 10 simulations.
    """
    if not 0 < alpha < 1:
        raise InputError(f"expected alpha between 0 and 1, got {alpha}")
    if simulations < 10:
        raise InputError(f"expected at least 10 simulations, got {simulations}")
    power = np.empty((len(design.effects), len(sizes)))
    for column, n in enumerate(sizes):
        rng = np.random.default_rng([seed, n])  # a size's numbers do not hang on the other sizes
        p = np.empty((simulations, len(design.effects)))
        for row in range(simulations):
            p[row] = design.p_values(n, rng)
            if progress is not None:
                progress(1)
        power[:, column] = np.where(np.isnan(p).all(axis=0), np.nan, (p < alpha).mean(axis=0))
    se = np.sqrt(power * (1 - power) / simulations)
    return PowerResult(name, design.test, alpha, simulations, seed, tuple(sizes), design.effects, power, se)


def sample_size_text(result: PowerResult, design: Design, target: float, version: str) -> str:
    """A paragraph for a plan or preregistration: the population, the simulation, N for each effect."""
    smallest = result.smallest_n(target)
    said = []
    for effect, row, errors in zip(result.effects, result.power, result.se, strict=True):
        n = smallest[effect]
        if n is None:
            best = float(np.nanmax(row)) if not np.isnan(row).all() else float("nan")
            said.append(f"{effect}: not reached with up to {result.n[-1]} participants (at most {best:.2f})")
        else:
            at = result.n.index(n)
            said.append(f"{effect}: N = {n} (power {row[at]:.2f}, simulation error {errors[at]:.3f})")
    return (
        f"Sample size was planned by simulation with Palpebra {version}. {design.population}. For each "
        f"number of participants {result.simulations} data sets were drawn (seed {result.seed}) and analysed "
        f"as the study will be ({design.test}), at alpha = {result.alpha:g}. Smallest number of participants "
        f"with a power of {target:g}: {'; '.join(said)}."
    )
