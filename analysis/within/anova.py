"""The n-way within-participant ANOVA: univariate and multivariate tests of every effect."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.within.contrasts import effect_members, effect_scores, rotate
from analysis.within.effect_tests import Effect, above_noise, effects_of, reduce_scores
from experiments.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class AnovaResult:
    """Every effect of a within-participant design, and the cell means (N, a, b, ...) it came from."""

    effects: tuple[Effect, ...]
    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    n_participants: int
    ss_participants: float
    confidence: float
    y: Floats = field(repr=False, compare=False)

    def effect(self, name: str) -> Effect:
        """Return the effect called `name`, its factors in any order."""
        wanted = frozenset(name.split(":"))
        for effect in self.effects:
            if effect.effect == name or frozenset(effect.factors) == wanted:
                return effect
        raise InputError(
            f"no effect is called '{name}'; effects: {', '.join(e.effect for e in self.effects)}"
        )


def within_anova(
    y: ArrayLike,
    factors: Sequence[str],
    levels: Sequence[Sequence[str]] | None = None,
    confidence: float = 0.95,
) -> AnovaResult:
    """Repeated-measures ANOVA with any number of within factors and no between factor.

    Parameters
    ----------
    y : (N, a, b, ...) participants' cell means, one axis a factor; complete, finite, N >= 2.
    factors : names of the factors, in axis order.
    levels : level names of each factor, in index order; numbers from 1 where None.
    confidence : coverage of the intervals of partial eta squared.

    Raises
    ------
    InputError
        One participant, a factor with one level, missing values, or names that do not fit the shape.

    Notes
    -----
    Univariate, Greenhouse-Geisser, Huynh-Feldt (Lecoutre's correction equals it here), Mauchly, and the
    multivariate test Hotelling-Lawley on (q, N - q) df that the paper prints.
    Source: Maxwell & Delaney (2004), chapters 11-14; Olejnik & Algina (2003) for generalised eta squared.
    """
    cells = _checked(y, factors, levels)
    n, k = cells.shape[0], cells[0].size
    floor = n * k * (8 * np.finfo(float).eps * float(np.abs(cells).max())) ** 2
    participant_means = cells.reshape(n, -1).mean(axis=1)
    spread = participant_means - participant_means.mean()
    ss_participants = above_noise(k * float(spread @ spread), floor)
    centred = cells - participant_means.reshape(-1, *[1] * len(factors))
    rotated = rotate(centred)
    scores = [reduce_scores(effect_scores(rotated, m), m, floor) for m in effect_members(len(factors))]
    names = levels or [[str(i + 1) for i in range(size)] for size in cells.shape[1:]]
    return AnovaResult(
        effects=effects_of(scores, n, list(factors), ss_participants, confidence),
        factors=tuple(factors),
        levels=tuple(tuple(str(level) for level in group) for group in names),
        n_participants=n,
        ss_participants=ss_participants,
        confidence=confidence,
        y=cells,
    )


def _checked(y: ArrayLike, factors: Sequence[str], levels: Sequence[Sequence[str]] | None) -> Floats:
    cells = np.asarray(y, dtype=np.float64)
    if cells.ndim != len(factors) + 1 or not factors:
        raise InputError(
            f"expected one axis for participants and one for each of {list(factors)}, got {cells.shape}"
        )
    if cells.shape[0] < 2:
        raise InputError(
            f"expected at least 2 complete participants, got {cells.shape[0]}; the test has no error term"
        )
    for factor, size in zip(factors, cells.shape[1:], strict=True):
        if size < 2:
            raise InputError(f"expected at least 2 levels of '{factor}', got {size}; leave the factor out")
    if levels is not None and tuple(len(group) for group in levels) != cells.shape[1:]:
        raise InputError(
            f"expected level names for the shape {cells.shape[1:]}, got {[len(g) for g in levels]}"
        )
    if not np.isfinite(cells).all():
        raise InputError("expected a finite mean in every cell; drop participants with empty cells first")
    return cells
