"""What a fitted linear mixed model says: tests, coefficients, components."""

from dataclasses import dataclass, field
from typing import Literal

from analysis.models.random_part import Component
from analysis.models.roles import Slopes

DfMethod = Literal["satterthwaite", "kenward-roger"]


@dataclass(frozen=True)
class MixedEffect:
    """Type III test of a fixed effect; `df_error` is Satterthwaite's, or Kenward and Roger's."""

    effect: str
    f_value: float
    df_effect: int
    df_error: float
    p_value: float


@dataclass(frozen=True)
class Coefficient:
    """A sum-coded fixed coefficient with its t test; Kenward and Roger adjust `se` too.

    `ci` is its profile likelihood interval, where asked for.
    """

    name: str
    estimate: float
    se: float
    df: float
    t: float
    p_value: float
    ci: tuple[float, float] | None = None


@dataclass(frozen=True)
class MixedResult:
    """A fitted mixed model.

    Attributes
    ----------
    singular : bool
        Some variance is estimated as zero.
    """

    formula: str
    slopes: Slopes
    effects: tuple[MixedEffect, ...]
    coefficients: tuple[Coefficient, ...]
    components: tuple[Component, ...]
    reml_criterion: float
    sigma: float
    theta: tuple[float, ...]
    n_ratings: int
    n_participants: int
    n_items: int
    n_groups: dict[str, int]
    singular: bool
    notes: tuple[str, ...] = ()
    factors: tuple[str, ...] = field(default=())
    df_method: DfMethod = "satterthwaite"
