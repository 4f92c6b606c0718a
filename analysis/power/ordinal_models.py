"""Power of ordinal mixed models: ratings as ordered categories."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special

from analysis.models.ordinal import MAXIMUM_CATEGORIES, fit_ordinal
from analysis.power.conditions import refuse_no_difference
from experiments.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class OrdinalDesign:
    r"""Conditions rated on ordered categories by participants who all see every clip.

    Attributes
    ----------
    differences : tuple of float
        Of every further condition from the first, in log odds of a higher category.
    shares : tuple of float
        How often each category is given to a clip of the first condition by a participant, both of no
        leaning of their own; they are divided by their sum.
    clips : int
        Shared evenly by the conditions.
    crossed : bool
        Whether each clip is shown in every condition; else in one, as many in each.
    sd_participant, sd_slope, sd_clip : float
        In log odds: of participants, of their differences between any two conditions, of clips.

    Notes
    -----
    :math:`P(y \le k) = \mathrm{logit}^{-1}(\theta_k - \eta)`, with :math:`\theta_k` the log odds of the
    cumulated shares.
    """

    differences: tuple[float, ...]
    shares: tuple[float, ...]
    clips: int
    crossed: bool = False
    sd_participant: float = 1.0
    sd_slope: float = 0.5
    sd_clip: float = 0.5

    def __post_init__(self) -> None:
        if not 2 <= len(self.shares) <= MAXIMUM_CATEGORIES or min(self.shares) <= 0:
            raise InputError(
                f"expected the shares of 2 to {MAXIMUM_CATEGORIES} categories, all above 0: 5,15,30,30,20"
            )
        refuse_no_difference(self.differences)
        if self.clips < 2 or (not self.crossed and self.clips % self.conditions):
            raise InputError(
                f"{self.clips} clips cannot be shared evenly by {self.conditions} conditions; expected a "
                f"multiple of {self.conditions}, or --crossed"
            )

    @property
    def conditions(self) -> int:
        """How many there are."""
        return len(self.differences) + 1

    @property
    def effects(self) -> tuple[str, ...]:
        """The one test."""
        return ("condition",)

    @property
    def test(self) -> str:
        """The test, in a few words."""
        return "cumulative logit mixed model, Wald"

    @property
    def population(self) -> str:
        """The population in a sentence."""
        shares = ", ".join(f"{share:.0%}" for share in self._shares)
        shown = "each shown in every condition" if self.crossed else "as many of each condition"
        odds = ", ".join(f"{np.exp(difference):.3g}" for difference in self.differences)
        which = "the second" if self.conditions == 2 else "the further conditions"
        return (
            f"Ratings in {len(self.shares)} categories with shares {shares} in the first condition; the odds "
            f"of a higher category are {odds} times as large in {which}; SDs in log odds: participants "
            f"{self.sd_participant:g}, their difference {self.sd_slope:g}, clips {self.sd_clip:g}; "
            f"{self.clips} clips, {shown}, rated once by everybody"
        )

    @property
    def _shares(self) -> Floats:
        given = np.array(self.shares, dtype=np.float64)
        shares: Floats = given / given.sum()
        return shares

    @cached_property
    def _shown(self) -> NDArray[np.int64]:
        """Clip and condition of each of a participant's trials (trials, 2)."""
        clip = np.arange(self.clips)
        if not self.crossed:
            return np.stack([clip, clip % self.conditions], axis=1)
        every = np.arange(self.conditions)
        return np.stack([np.tile(clip, self.conditions), np.repeat(every, self.clips)], axis=1)

    def drawn(self, n: int, rng: np.random.Generator) -> pd.DataFrame:
        """One data set: participant, clip, condition and rating (1 for the first category) of each trial."""
        clip, condition = np.tile(self._shown, (n, 1)).T
        person = np.repeat(np.arange(n), len(self._shown))
        own = self.sd_slope / np.sqrt(2) * rng.normal(size=(n, self.conditions))
        apart = np.array([0.0, *self.differences]) + own - own[:, :1]
        eta = self.sd_participant * rng.normal(size=n)[person] + apart[person, condition]
        eta = eta + self.sd_clip * rng.normal(size=self.clips)[clip]
        thresholds = special.logit(np.cumsum(self._shares)[:-1])
        noise = special.logit(rng.uniform(size=len(eta)))
        rating = 1 + (thresholds < (eta + noise)[:, None]).sum(axis=1)
        columns = {"participant": person, "clip": clip, "condition": condition, "rating": rating}
        return pd.DataFrame(columns)

    def p_values(self, n: int, rng: np.random.Generator) -> Sequence[float]:
        """The p of the condition; NaN where the data leave it undetermined."""
        rows = self.drawn(n, rng).astype(dict.fromkeys(("participant", "clip", "condition"), str))
        try:
            model = fit_ordinal(rows, "participant", "rating", ["condition"], "clip", "main", quadrature=1)
        except InputError:
            return [float("nan")]
        return [model.effects[0].p_value]
