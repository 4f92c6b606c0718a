"""Power by simulation: synthetic participants drawn again and again from one population."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.synthetic.synthesise import Plan, Population, population_of
from experiments.errors import InputError

Floats = NDArray[np.float64]
Statistic = Literal["multivariate", "greenhouse-geisser"]

CHUNK_VALUES = 4_000_000
"""Simulated cell means held in memory at once."""


@dataclass(frozen=True)
class PowerResult:
    """Share of significant tests, (effects, sample sizes), with standard errors; NaN where no test exists."""

    experiment: str
    statistic: str
    alpha: float
    simulations: int
    seed: int
    n: tuple[int, ...]
    effects: tuple[str, ...]
    power: Floats = field(repr=False)
    se: Floats = field(repr=False)

    def smallest_n(self, target: float) -> dict[str, int | None]:
        """For every effect, the smallest simulated n from which on the power stays at `target` or above."""
        smallest: dict[str, int | None] = {}
        for effect, row in zip(self.effects, self.power, strict=True):
            # NaN, where no test exists, is not enough.
            enough = np.nan_to_num(row) >= target
            # After the last size that is not enough: power may dip below the target by chance.
            start = len(row) - int(np.argmin(enough[::-1])) if not enough.all() else 0
            smallest[effect] = self.n[start] if start < len(row) else None
        return smallest


def sample_sizes(text: str) -> tuple[int, ...]:
    """Read `10:60:5` (first, last, step), `10:60`, or `20,30,43`; InputError for anything else."""
    try:
        parts = [int(part) for part in text.replace(",", ":").split(":")]
    except ValueError:
        raise InputError(f"expected sample sizes as 10:60:5 or 20,30,43, got '{text}'") from None
    if ":" in text and "," not in text and len(parts) in (2, 3):
        step = parts[2] if len(parts) == 3 else 1
        if step < 1 or parts[1] < parts[0]:
            raise InputError(f"expected first:last:step with first <= last and step >= 1, got '{text}'")
        parts = list(range(parts[0], parts[1] + 1, step))
    elif ":" in text:
        raise InputError(f"expected sample sizes as 10:60:5 or 20,30,43, got '{text}'")
    # Below three there is no residual; above 5000 a typing error is likelier.
    if min(parts) < 3 or max(parts) > 5000:
        raise InputError(f"expected sample sizes from 3 to 5000, got {min(parts)} to {max(parts)}")
    return tuple(sorted(set(parts)))


def simulate_power(
    plan: Plan,
    sizes: Sequence[int],
    simulations: int = 1000,
    alpha: float = 0.05,
    seed: int = 1,
    statistic: Statistic = "multivariate",
    progress: Callable[[int], None] | None = None,
) -> PowerResult:
    """Simulate the tests of every effect whose size is known (printed or wished).

    The population has the means and covariance that give the plan's figures at the plan's own n; cell means
    are clipped to the scale and rounded to what the trials of a cell can give. `progress` gets the number of
    data sets just finished.
    """
    if not 0 < alpha < 1:
        raise InputError(f"expected alpha between 0 and 1, got {alpha}")
    if simulations < 10:
        raise InputError(f"expected at least 10 simulations, got {simulations}")
    rng = np.random.default_rng(seed)
    population = population_of(plan, rng)
    # Effects with a mere bound on p have no size to simulate.
    known = [t.name.removeprefix("F ") for t in plan.targets.tests if t.start is not None]
    effects = tuple(e for e in plan.space.effects if e in known)
    contrasts = [plan.space.effects[e] for e in effects]
    power = np.empty((len(effects), len(sizes)))
    for column, n in enumerate(sizes):
        hits, done = np.zeros(len(effects)), 0
        while done < simulations:
            # In chunks, so that large samples do not fill the memory.
            count = min(simulations - done, max(1, CHUNK_VALUES // (n * plan.space.n_cells)))
            y = _draw(plan, population, count, n, rng)
            hits += [_significant(y @ c, alpha, statistic) for c in contrasts]
            done += count
            if progress is not None:
                progress(count)
        power[:, column] = hits / simulations
    # The standard error of a share of independent data sets (binomial).
    se = np.sqrt(power * (1 - power) / simulations)
    return PowerResult(
        plan.experiment.name, statistic, alpha, simulations, seed, tuple(sizes), effects, power, se
    )


def _draw(plan: Plan, population: Population, count: int, n: int, rng: np.random.Generator) -> Floats:
    """Cell means (count, n, cells) as ratings of the experiment's trials can give them."""
    values, vectors = np.linalg.eigh(population.covariance)
    # Rounding may leave eigenvalues a little below zero, which have no root.
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    y = population.means + rng.normal(size=(count, n, len(values))) @ root.T
    trials = plan.experiment.exemplars.per_cell * plan.experiment.blocks.repeats
    # A mean of whole ratings is a whole number of their sum.
    return np.asarray(np.rint(np.clip(y, plan.scale.minimum, plan.scale.maximum) * trials) / trials)


def _significant(z: Floats, alpha: float, statistic: Statistic) -> float:
    r"""How many data sets of contrast scores z (count, n, q) have p below alpha; NaN where no test exists.

    .. math::

        F &= \frac{n - q}{q} \, n \, \bar z' E^{-1} \bar z \quad\text{on } q, n - q \text{ df} \tag{1} \\
        F &= n (n - 1) \frac{\bar z' \bar z}{\mathrm{tr} E}
            \quad\text{on } q \hat\epsilon, q (n - 1) \hat\epsilon
            \text{ df}, \qquad \hat\epsilon = \frac{(\mathrm{tr} E)^2}{q \, \mathrm{tr}(E^2)} \tag{2}

    z bar are the contrasts' means over n people and E their sums of squares and products about them: (1) is
    the multivariate test, (2) the univariate one with Greenhouse and Geisser's correction.
    """
    _, n, q = z.shape
    mean = z.mean(axis=1)
    residual = z - mean[:, None, :]
    error = residual.transpose(0, 2, 1) @ residual
    if statistic == "multivariate":
        # The matrix of error would be singular.
        if n <= q:
            return float("nan")
        size = n * np.einsum("sq,sq->s", mean, np.linalg.solve(error, mean[:, :, None])[:, :, 0])
        return float((special.fdtrc(q, n - q, size * (n - q) / q) < alpha).sum())
    trace = np.einsum("sqq->s", error)
    # Greenhouse and Geisser's, estimated in each data set as an analysis would.
    epsilon = trace**2 / (q * np.einsum("sij,sij->s", error, error))
    f = n * (mean**2).sum(axis=1) / trace * (n - 1)
    return float((special.fdtrc(q * epsilon, q * epsilon * (n - 1), f) < alpha).sum())


# Power of any design that can draw a data set and test it, and what a plan says of its sample size.


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
        Significance level of the tests.
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
        rng = np.random.default_rng([seed, n])  # a size's numbers do not depend on the other sizes
        p = np.empty((simulations, len(design.effects)))
        for row in range(simulations):
            p[row] = design.p_values(n, rng)
            if progress is not None:
                progress(1)
        # A comparison with NaN is false: a data set without a test is one without a finding.
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
            # All NaN: no data set of any size allows the test.
            why = "no data set allowed the test"
            if not np.isnan(row).all():
                why = f"maximum power {float(np.nanmax(row)):.2f}"
            said.append(f"{effect}: not reached with up to {result.n[-1]} participants ({why})")
        else:
            at = result.n.index(n)
            said.append(f"{effect}: N = {n} (power {row[at]:.2f}, simulation error {errors[at]:.3f})")
    return (
        f"Sample size was planned by simulation with Palpebra {version}. {design.population}. For each "
        f"number of participants, {result.simulations} data sets were simulated (seed {result.seed}) and "
        f"analyzed with {design.test}, with alpha = {result.alpha:g}. Of the "
        f"numbers tried ({', '.join(map(str, result.n))}), the smallest with a power of {target:g} were: "
        f"{'; '.join(said)}."
    )
