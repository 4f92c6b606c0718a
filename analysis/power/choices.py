"""Power of paired comparisons and of differences between thresholds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import special
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.pairs.comparisons import TIE
from analysis.pairs.likelihood import Counts, Fit, Model, fit, free_abilities, sandwich, scores
from analysis.thresholds.likelihood import Likelihood, Shape, Trials, function
from analysis.thresholds.psychometric import refuse_unfit
from experiments.errors import InputError

# Power of paired comparisons.

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PairsDesign:
    """Comparisons of items, every pair equally often, by Bradley and Terry's or Davidson's model.

    Attributes
    ----------
    abilities : tuple of float
        Log odds: an item one above another is chosen in 73% of their comparisons.
    repeats : int
        Comparisons of each pair by each participant.
    rater_sd : float
        How far participants' own log odds of a pair lie from the population's.
    tie : float
        Probability that two items of one ability tie; above 0 by Davidson's model.
    """

    abilities: tuple[float, ...]
    repeats: int = 1
    rater_sd: float = 0.0
    tie: float = 0.0

    def __post_init__(self) -> None:
        if len(self.abilities) < 2:
            raise InputError("expected the abilities of at least two items, such as 0,0.3,0.6")
        if self.repeats < 1:
            raise InputError(f"expected at least one comparison of each pair, got {self.repeats}")
        if not 0 <= self.tie < 1:
            raise InputError(f"expected a probability of ties from 0 to below 1, got {self.tie:g}")

    @cached_property
    def _pairs(self) -> NDArray[np.int64]:
        return np.array(list(combinations(range(len(self.abilities)), 2)), dtype=np.int64)

    @property
    def effects(self) -> tuple[str, ...]:
        """Whether items differ at all, and every pair of neighbors in ability."""
        return ("all items", *(f"item {a + 1} or {b + 1}" for a, b in self._neighbours))

    @cached_property
    def _neighbours(self) -> list[tuple[int, int]]:
        order = np.argsort(self.abilities, kind="stable").tolist()
        # The better item first, and no pair of equal ones: they have no difference to find.
        return [(b, a) for a, b in pairwise(order) if self.abilities[a] != self.abilities[b]]

    @property
    def test(self) -> str:
        """The test, in a few words."""
        model = "Davidson" if self.tie else "Bradley-Terry"
        if self.rater_sd:
            return f"{model}, errors robust to raters: F of all, t of neighbors"
        return f"{model}: likelihood ratio of all, Wald of neighbors"

    @property
    def population(self) -> str:
        """The population in a sentence."""
        abilities = ", ".join(f"{ability:g}" for ability in self.abilities)
        often = "once" if self.repeats == 1 else f"{self.repeats} times"
        said = f"{len(self.abilities)} items have abilities (log odds) {abilities}"
        said += f"; every participant compares each pair {often}"
        if self.rater_sd:
            said += f"; participants' log odds of a pair have an SD of {self.rater_sd:g}"
        if self.tie:
            said += f"; two equal items tie with probability {self.tie:g}"
        return said

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of each test in one data set; Firth's penalty where an item wins or loses throughout.

        Where raters differ, comparisons of one rater are not independent trials: tests then have raters as
        clusters (Liang & Zeger 1986), F on (q, n - q) df for q + 1 items, t on n - 1. With ties the penalty
        does not exist: data without finite estimates then allow no test.
        """
        of_raters = self._outcomes(n, rng)
        first, second = self._pairs.T
        counts = Counts(first, second, of_raters.sum(axis=0))
        model = _model(counts, len(self.abilities))
        try:
            fitted, finite = _fitted(model, counts)
        except InputError:
            return [float("nan")] * len(self.effects)
        if self.rater_sd and finite:
            return self._robust_p(model, fitted, of_raters[:, :, : fitted.shares.shape[1]])
        q, full = len(self.abilities) - 1, free_abilities(len(self.abilities))
        chi2 = 2 * (fitted.log_likelihood - _equal(counts))
        # Rounding may leave it a little below zero.
        p = [float(special.chdtrc(q, max(chi2, 0.0)))]
        for a, b in self._neighbours:
            contrast = full[a] - full[b]
            z = contrast @ fitted.parameters[:q] / np.sqrt(contrast @ fitted.covariance[:q, :q] @ contrast)
            p.append(float(2 * special.ndtr(-abs(z))))
        return p

    def _outcomes(self, n: int, rng: np.random.Generator) -> Floats:
        """Choices of the first item, of the second, and ties (n, pairs, 2 or 3)."""
        first, second = self._pairs.T
        abilities = np.array(self.abilities)
        logit = (abilities[first] - abilities[second])[None] + rng.normal(
            0, 1, (n, len(first))
        ) * self.rater_sd
        if not self.tie:
            chosen = rng.binomial(self.repeats, special.expit(logit)).astype(np.float64)
            return np.stack([chosen, self.repeats - chosen], axis=2)
        # The share nu / (2 + nu) of comparisons of equal items are ties.
        log_nu = np.full_like(logit, np.log(2 * self.tie / (1 - self.tie)))
        shares = special.softmax(np.stack([logit / 2, -logit / 2, log_nu], axis=2), axis=2)
        return rng.multinomial(self.repeats, shares).astype(np.float64)

    def _robust_p(self, model: Model, fitted: Fit, of_raters: Floats) -> list[float]:
        r"""Tests with raters as clusters; `of_raters` (n, pairs, outcomes).

        .. math::

            F = \frac{n - q}{q (n - 1)} \hat\lambda' V^{-1} \hat\lambda
                \quad\text{on } q, n - q \text{ df}, \qquad
            t = \frac{c' \hat\lambda}{\sqrt{c' V c}} \quad\text{on } n - 1 \text{ df} \tag{1}

        lambda are the q free abilities, V their covariance with raters as clusters, c the contrast of two
        items and n the raters: F is that of Hotelling's T^2.
        """
        n, q, full = len(of_raters), len(self.abilities) - 1, free_abilities(len(self.abilities))
        if n <= q:
            return [float("nan")] * len(self.effects)
        clusters = np.einsum(
            "nmo,mop->np", of_raters - self.repeats * fitted.shares, scores(model, *self._pairs.T)
        )
        covariance = sandwich(fitted, clusters)[:q, :q]
        if np.linalg.matrix_rank(covariance, hermitian=True) < q:
            return [float("nan")] * len(self.effects)
        estimates = fitted.parameters[:q]
        t2 = float(estimates @ np.linalg.solve(covariance, estimates))
        p = [float(special.fdtrc(q, n - q, t2 * (n - q) / (q * (n - 1))))]
        for a, b in self._neighbours:
            contrast = full[a] - full[b]
            t = contrast @ estimates / np.sqrt(contrast @ covariance @ contrast)
            p.append(float(2 * special.stdtr(n - 1, -abs(t))))
        return p


def _model(counts: Counts, items: int) -> Model:
    """Davidson's model where a comparison was tied, else Bradley and Terry's."""
    with_ties = counts.outcomes.shape[1] > TIE and counts.outcomes[:, TIE].any()
    return Model("davidson" if with_ties else "bradley-terry", free_abilities(items))


def _fitted(model: Model, counts: Counts) -> tuple[Fit, bool]:
    """The fit, and whether it is finite without Firth's penalty."""
    if model.method == "davidson":
        return fit(model, counts), True
    decided = replace(counts, outcomes=counts.outcomes[:, :TIE])
    try:
        return fit(model, decided), True
    except InputError:
        return fit(model, decided, firth=True), False


def _equal(counts: Counts) -> float:
    """The log-likelihood of items that are alike: either side as often, ties as often as there were."""
    total = float(counts.outcomes.sum())
    tied = float(counts.outcomes[:, TIE:].sum())
    decided = total - tied
    # 0 log 0 is 0 here, where nothing was tied.
    return float(special.xlogy(tied, tied / total) + special.xlogy(decided, decided / (2 * total)))


# Power of differences between thresholds.

POOL = 400
"""Simulated people whose thresholds are fitted; data sets draw from them."""


@dataclass(frozen=True)
class ThresholdDesign:
    """A threshold of each participant in two conditions, compared by a paired t test.

    Attributes
    ----------
    levels : tuple of float
        Stimuli shown.
    trials : int
        Of each stimulus, in a condition.
    threshold, difference : float
        Of the first condition on average, and how much higher the second is, in units of the stimulus.
    person_sd, difference_sd : float
        How far people's thresholds, and their differences, spread.
    spread : float
        Of the psychometric function (SD of the normal, scale of the logistic, exponent of the Weibull).
    guess, lapse : float
        Asymptotes are guess and 1 - lapse.
    shape : {"normal", "logistic", "weibull"}
    seed : int
        Of the people simulated.
    """

    levels: tuple[float, ...]
    trials: int
    threshold: float
    difference: float
    person_sd: float
    difference_sd: float
    spread: float
    guess: float = 0.0
    lapse: float = 0.0
    shape: Shape = "normal"
    seed: int = 1

    def __post_init__(self) -> None:
        if len(self.levels) < 2 or self.trials < 1:
            raise InputError("expected at least two stimuli and one trial of each")
        if self.spread <= 0 or self.person_sd < 0 or self.difference_sd < 0:
            raise InputError("expected a spread above 0 and SDs of at least 0")
        if not 0 <= self.guess < 1 - self.lapse <= 1:
            raise InputError("expected guess and lapse rates of at least 0 whose sum is below 1")
        if self.shape == "weibull" and min(self.levels) <= 0:
            raise InputError("the Weibull function needs stimuli above 0; use the normal")

    @property
    def effects(self) -> tuple[str, ...]:
        """The one test."""
        return ("difference of thresholds",)

    @property
    def test(self) -> str:
        """The test, in a few words."""
        return "paired t test of fitted thresholds"

    @property
    def population(self) -> str:
        """The population in a sentence."""
        return (
            f"Thresholds are {self.threshold:g} on average (SD over people {self.person_sd:g}) and "
            f"{self.difference:g} higher in the second condition (SD {self.difference_sd:g}); {self.shape} "
            f"functions with spread {self.spread:g}, guess rate {self.guess:g}, lapse rate {self.lapse:g}; "
            f"{self.trials} trials at each of {len(self.levels)} stimuli from {min(self.levels):g} to "
            f"{max(self.levels):g} in either condition; data sets draw from {POOL} simulated people"
            f"{self._left_out}"
        )

    @property
    def _left_out(self) -> str:
        share = 1 - float(np.isfinite(self.differences).mean())
        if share == 0:
            return ""
        # Less than half a percent is not none.
        said = "less than 1%" if share < 0.005 else f"{share:.0%}"
        return f", of whom {said} are left out because a threshold cannot be fitted to these stimuli"

    @cached_property
    def differences(self) -> Floats:
        """Fitted differences of the pool of simulated people; NaN where a threshold cannot be fitted."""
        rng = np.random.default_rng([self.seed, POOL])
        first = self.threshold + self.person_sd * rng.normal(size=POOL)
        second = first + self.difference + self.difference_sd * rng.normal(size=POOL)
        # sums this short only wait for a second thread
        with threadpool_limits(1, "blas"):
            a, b = ([self._measured(one, rng) for one in every] for every in (first, second))
        return np.array(b, dtype=np.float64) - np.array(a, dtype=np.float64)

    def _measured(self, threshold: float, rng: np.random.Generator) -> float:
        x = np.array(self.levels, dtype=np.float64)
        # A Weibull threshold is above 0, however far people spread.
        location = max(threshold, 1e-6) if self.shape == "weibull" else threshold
        share = function(self.shape, x, location, float(np.log(self.spread)))
        chance = self.guess + (1 - self.guess - self.lapse) * share
        count = np.full(len(x), float(self.trials))
        yes = rng.binomial(self.trials, chance).astype(np.float64)
        trials = Trials(x, count, yes)
        try:
            refuse_unfit(trials, self.shape)
        except InputError:
            return float("nan")
        model = Likelihood(trials, self.shape, self.guess, self.lapse, falling=False)
        fitted = float(model.maximum({}, np.array([location, np.log(self.spread)]))[0][0])
        low, high = float(x.min()), float(x.max())
        # So far from all stimuli the fit has found no threshold.
        outside = not low - 3 * (high - low) <= fitted <= high + 3 * (high - low)
        return float("nan") if outside else fitted

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of one data set of n people of the pool; people who cannot be fitted are left out."""
        drawn = self.differences[rng.integers(0, POOL, n)]
        given = drawn[np.isfinite(drawn)]
        if len(given) < 2 or np.ptp(given) == 0:
            return [float("nan")]
        t = float(given.mean() / (given.std(ddof=1) / np.sqrt(len(given))))
        return [float(2 * special.stdtr(len(given) - 1, -abs(t)))]
