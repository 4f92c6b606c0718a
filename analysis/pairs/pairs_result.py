"""What a model of paired comparisons tells: abilities, contrasts, parameters, fit."""

from dataclasses import dataclass, field

from analysis.pairs.factors import FactorTest
from analysis.pairs.likelihood import Method
from analysis.pairs.transitivity import Transitivity


@dataclass(frozen=True)
class Item:
    """One item: ability against the first item in sorted order, on the method's scale."""

    name: str
    ability: float
    se: float
    p: float
    ci_low: float
    ci_high: float
    se_robust: float | None
    se_centred: float
    centred: float
    rank: int
    wins: int
    losses: int
    ties: int


@dataclass(frozen=True)
class Contrast:
    """Difference of two abilities, and its Holm-corrected p.

    `se_robust` has raters as clusters, `p_robust` is its t test on as many df as raters less one,
    `p_robust_holm` corrected like the model's.
    """

    first: str
    second: str
    difference: float
    se: float
    z: float
    p: float
    p_holm: float
    se_robust: float | None = None
    p_robust: float | None = None
    p_robust_holm: float | None = None


@dataclass(frozen=True)
class Parameter:
    """One more parameter of the model, or a test of it."""

    estimate: float
    se: float
    z: float
    p: float


@dataclass(frozen=True)
class Goodness:
    """Likelihood-ratio statistic against the saturated model of the pairs."""

    deviance: float
    df: int
    p: float
    ordered: bool


@dataclass(frozen=True)
class PairsResult:
    """Everything `analysis pairs` knows of a table; `docs/analysis.md` says what each key is."""

    method: Method
    scale: str
    reference: str
    items: tuple[Item, ...]
    contrasts: tuple[Contrast, ...]
    covariance: tuple[tuple[float, ...], ...]
    n_comparisons: int
    n_ties: int
    n_participants: int | None
    log_likelihood: float
    goodness: Goodness
    order_effect: Parameter | None
    log_nu: Parameter | None
    tie_probability_max: float | None
    factors: tuple[FactorTest, ...]
    transitivity: Transitivity
    firth: bool
    decisions: tuple[str, ...] = field(default_factory=tuple)


SCALES: dict[Method, str] = {
    "bradley-terry": "log odds of winning",
    "davidson": "log odds of winning, given that there is no tie",
    "thurstone": "standard deviations of the difference of two items (case V; x 1.414 for those of an item)",
}
