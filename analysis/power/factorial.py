"""Power of factorial designs within, between and mixed, by the analysis that the data will get."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.within.anova import linear_anova
from analysis.within.between import BetweenDesign, Covariate, between_design, no_groups
from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]
Statistic = Literal["multivariate", "greenhouse-geisser"]


# Decision 0144: Power is simulated from the published effect at the published n.
@dataclass(frozen=True)
class FactorialDesign:
    r"""Cell means of participants, all with one SD and one correlation between any two cells.

    Attributes
    ----------
    within, between : mapping from str to int
        Factors and their numbers of levels.
    sizes : mapping from str to float
        Cohen's f of effects (`face`, `face:group`): the root mean square of the effect's share in the cells'
        means, in SDs of a cell over participants. The share is a straight line over the levels of a factor,
        and the product of these lines for interactions. Effects not named are zero.
    correlation : float
        Correlation between two cells of a participant.
    statistic : {"multivariate", "greenhouse-geisser"}
    covariate : float
        Correlation of a covariate with participants' mean ratings within groups; 0 is a design without one.

    Notes
    -----
    With k cells per participant, a within effect has :math:`\lambda = N k f^2 / (1 - \rho)`, one between
    :math:`\lambda = N k f^2 / (1 + (k - 1) \rho)`, of the noncentral F (Cohen 1988). A covariate
    that correlates by r with participants' means divides the latter by :math:`1 - r^2` and takes
    one error df.
    """

    within: Mapping[str, int]
    between: Mapping[str, int]
    sizes: Mapping[str, float]
    correlation: float = 0.5
    statistic: Statistic = "greenhouse-geisser"
    covariate: float = 0.0
    _designs: dict[int, BetweenDesign] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        levels = {**self.between, **self.within}
        if len(levels) < len(self.between) + len(self.within):
            raise InputError("a factor is named both within and between participants; remove it from one")
        if not self.sizes:
            raise InputError("no effect has a size; name one with --effect, such as face=0.25")
        self._refuse_odd_effects(list(levels))
        if any(size < 2 for size in levels.values()):
            raise InputError("expected at least 2 levels of every factor")
        if not -1 < self.covariate < 1:
            raise InputError(f"expected a covariate's correlation between -1 and 1, got {self.covariate:g}")
        k = int(np.prod(list(self.within.values()), dtype=np.int64))
        if not -1 / max(k - 1, 1) < self.correlation < 1:
            raise InputError(f"{k} cells cannot all correlate {self.correlation:g} with each other")

    def _refuse_odd_effects(self, factors: list[str]) -> None:
        known: dict[frozenset[str], str] = {}
        for effect in self.sizes:
            names = effect.split(":")
            for name in names:
                if name not in factors:
                    raise InputError(f"--effect: there is no factor '{name}'{did_you_mean(name, factors)}")
            if len(set(names)) < len(names):
                raise InputError(f"--effect: '{effect}' names a factor twice; an effect names each once")
            # Both would be added up to one larger effect.
            if (same := known.setdefault(frozenset(names), effect)) != effect:
                raise InputError(f"--effect: '{same}' and '{effect}' are the same effect; give it once")

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that have a size."""
        return tuple(self.sizes)

    @property
    def test(self) -> str:
        """The test, in a few words."""
        if not self.within:
            said = "F tests"
        else:
            multivariate = self.statistic == "multivariate"
            said = "F tests, multivariate" if multivariate else "F tests, Greenhouse-Geisser"
        return f"{said}, with the covariate" if self.covariate else said

    @property
    def population(self) -> str:
        """The population in a sentence."""
        parts = [f"{name} ({size} levels, within)" for name, size in self.within.items()]
        parts += [f"{name} ({size} groups)" for name, size in self.between.items()]
        sizes = ", ".join(f"{effect} f = {size:g}" for effect, size in self.sizes.items())
        means = (
            f"participants' cell means correlate {self.correlation:g}"
            if self.within
            else "each participant gives one mean, so no correlation is assumed"
        )
        return (f"The design has {', '.join(parts)}; {means}; assumed effects (Cohen's f): {sizes}") + (
            f"; a covariate correlates {self.covariate:g} with participants' mean ratings"
            if self.covariate
            else ""
        )

    @cached_property
    def means(self) -> Floats:
        """Population means (groups, cells), in SDs; last factor fastest."""
        levels = {**self.between, **self.within}
        total = np.zeros(tuple(levels.values()))
        for effect, size in self.sizes.items():
            share = np.ones(())
            for name, count in levels.items():
                inside = name in effect.split(":")
                # Levels lie evenly along a line, so that an effect is linear in each of its factors.
                line = np.linspace(-1, 1, count) if inside else np.ones(count)
                share = share[..., None] * line
            # Scaled to an SD of f, as the means are in units of the SD within a cell.
            total += size * share / np.sqrt(np.mean(share**2))
        groups = int(np.prod(list(self.between.values()), dtype=np.int64))
        return total.reshape(groups, -1)

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of each effect in one data set; participants are dealt to groups in turn.

        NaN where there are no more participants than groups (and covariates), which leaves no error.
        """
        if n <= len(self.means) + (self.covariate != 0):
            return [np.nan] * len(self.sizes)
        group = np.arange(n) % len(self.means)
        noise = rng.normal(size=(n, self.means.shape[1]))
        shared = noise.mean(axis=1, keepdims=True)
        # what a person's cells share has the variance (1 + (k - 1) rho) / k, what they do not 1 - rho
        own = np.sqrt(1 - self.correlation) * (noise - shared)
        noise = own + np.sqrt(1 + (noise.shape[1] - 1) * self.correlation) * shared
        cells = (self.means[group] + noise).reshape(n, *self.within.values())
        design = self._between(n)
        if self.covariate:
            design = self._with_covariate(design, shared[:, 0], rng)
        result = linear_anova(cells, list(self.within), None, design)
        tests = [result.effect(effect) for effect in self.sizes]
        if self.statistic == "greenhouse-geisser":
            return [test.univariate.p_gg for test in tests]
        return [np.nan if test.multivariate is None else test.multivariate.p_value for test in tests]

    def _with_covariate(
        self, design: BetweenDesign, shared: Floats, rng: np.random.Generator
    ) -> BetweenDesign:
        """The design with a covariate of what a person's cells share."""
        r, n = self.covariate, len(shared)
        # `shared` is a mean of as many standard normals as there are cells
        own = shared * np.sqrt(self.means.shape[1])
        values = r * own + np.sqrt(1 - r**2) * rng.normal(size=n)
        covariate = Covariate("the covariate", values, float(values.mean()))
        return between_design(design.factors, design.levels, design.codes, [covariate])

    def _between(self, n: int) -> BetweenDesign:
        if not self.between:
            return no_groups(n)
        if n not in self._designs:
            every = list(product(*(range(size) for size in self.between.values())))
            codes = np.array([every[i % len(every)] for i in range(n)], dtype=np.int64)
            levels = [[str(i + 1) for i in range(size)] for size in self.between.values()]
            self._designs[n] = between_design(list(self.between), levels, codes)
        return self._designs[n]
