"""Power of differences between thresholds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.thresholds.likelihood import Likelihood, Shape, Trials, function
from analysis.thresholds.psychometric import refuse_unfit
from experiments.errors import InputError

Floats = NDArray[np.float64]


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
            raise InputError("expected guess and lapse rates of at least 0 that leave room between them")
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
        )

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
        outside = not low - 3 * (high - low) <= fitted <= high + 3 * (high - low)
        return float("nan") if outside else fitted

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of one data set of n people of the pool; who cannot be fitted is left out, as in a study."""
        drawn = self.differences[rng.integers(0, POOL, n)]
        given = drawn[np.isfinite(drawn)]
        if len(given) < 2 or np.ptp(given) == 0:
            return [float("nan")]
        t = float(given.mean() / (given.std(ddof=1) / np.sqrt(len(given))))
        return [float(2 * special.stdtr(len(given) - 1, -abs(t)))]
