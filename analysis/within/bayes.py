"""Bayes factors of the effects of a within-participant design (JZS priors), by one-dimensional integrals."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult
from analysis.within.strata import contrast_scores, effect_name
from experiments.errors import InputError

Floats = NDArray[np.float64]
Members = tuple[int, ...]
SCALE_FIXED, SCALE_RANDOM = 0.5, 1.0
"""Scales of the priors of effects and of participants, as in BayesFactor (`medium` and `nuisance`)."""
FACTORS_MAX = 4
LOG_G = np.linspace(-8.0, 25.0, 166)
"""Grid of the logarithms of variances; below it the priors vanish."""


@dataclass(frozen=True)
class BayesModel:
    """A model, the effects it has, and its Bayes factor against the model without any of them."""

    effects: tuple[str, ...]
    log_bf10: float


@dataclass(frozen=True)
class BayesEffect:
    """The evidence for an effect: models with it against the same models without, none with its interactions.

    `bf_inclusion` is their ratio of mean likelihoods, all models equally probable before the data.
    """

    effect: str
    bf_inclusion: float
    log_bf_inclusion: float


@dataclass(frozen=True)
class BayesAnova:
    """Bayes factors of every effect and model; `slopes` says whether participants differ in effects."""

    effects: tuple[BayesEffect, ...]
    models: tuple[BayesModel, ...]
    slopes: bool
    scale_fixed: float
    scale_random: float


def bayes_anova(anova: AnovaResult, slopes: bool = True) -> BayesAnova:
    r"""Compare all models of a within-participant design that have an interaction only with its parts.

    Parameters
    ----------
    anova : AnovaResult
        Without groups and covariates.
    slopes : bool
        Whether every model lets participants differ in all effects but the highest interaction, which is the
        residual of cell means. Without, participants differ in their means only, as in BayesFactor's
        `anovaBF`, which overstates the evidence if they differ in effects.

    Raises
    ------
    InputError
        Groups or covariates; more than four factors; no residual.

    Notes
    -----
    Rouder, Morey, Speckman & Province (2012, Journal of Mathematical Psychology 56, 356): with orthonormal
    contrasts of each effect, coefficients are normal with variance :math:`g_f \sigma^2`, those of
    participants :math:`g_s \sigma^2`, each g inverse-gamma(1/2, r^2/2); mean and sigma have Jeffreys' prior.
    Cell means of complete participants are orthogonal in all these effects, so that the likelihood,
    integrated over mean and coefficients, is with the precision :math:`\tau`

    .. math::

        m = \int \tau^{\nu / 2 - 1} e^{-\tau R / 2} \prod_b h_b(\tau) \, d\tau, \quad
        h_b(\tau) = \int p(g) \prod_i (1 + n_i(g))^{-q_i / 2} e^{-\tau S_i / (2 (1 + n_i(g)))} \, dg \tag{1}

    for blocks b of one or two g: participants; an effect; an effect with its slopes. S_i and q_i are a
    block's sums of squares and df, n_i(g) g times the number of values behind a coefficient, R the residual,
    and :math:`\nu` all cell means less one.
    """
    # With groups or covariates effects are no longer orthogonal, which the integrals need.
    if anova.between.factors or anova.between.matrix.shape[1] > 1:
        raise InputError("--bayes is for factors within participants; remove --between and --covariate")
    if len(anova.factors) > FACTORS_MAX:
        raise InputError(f"--bayes takes up to {FACTORS_MAX} factors, got {len(anova.factors)}")
    strata = _Strata(anova, slopes)
    effects = strata.effects
    with_effect = {effect: strata.block(effect, True) for effect in effects}
    without = {effect: strata.block(effect, False) for effect in effects}
    base = strata.log_density + strata.participants()
    logs = {}
    for model in _models(effects):
        # Blocks are independent given the precision: their logs add up.
        chosen = sum((with_effect[e] if e in model else without[e] for e in effects), base)
        logs[model] = float(special.logsumexp(chosen + strata.log_tau))
    null = logs[frozenset()]
    names = {effect: effect_name([anova.factors[k] for k in effect]) for effect in effects}
    inclusions = []
    for effect in effects:
        # Matched models: with the effect, and without interactions that contain it.
        bigger = [m for m in logs if effect in m and not any(set(effect) < set(other) for other in m)]
        ratio = special.logsumexp([logs[m] for m in bigger]) - special.logsumexp(
            [logs[m - {effect}] for m in bigger]
        )
        # exp overflows above 709; the logarithm keeps the whole.
        inclusions.append(BayesEffect(names[effect], float(np.exp(min(ratio, 700.0))), float(ratio)))
    models = sorted(logs.items(), key=lambda item: -item[1])
    return BayesAnova(
        tuple(inclusions),
        tuple(BayesModel(tuple(names[e] for e in effects if e in m), log - null) for m, log in models),
        slopes,
        SCALE_FIXED,
        SCALE_RANDOM,
    )


def _models(effects: Sequence[Members]) -> list[frozenset[Members]]:
    """Sets of effects that hold the parts of every interaction in them."""
    models = []
    for size in range(len(effects) + 1):
        for chosen in combinations(effects, size):
            inside = set(chosen)
            # An interaction without its parts would depend on how levels are coded.
            parts = (p for e in chosen for k in range(1, len(e)) for p in combinations(e, k))
            if inside.issuperset(parts):
                models.append(frozenset(chosen))
    return models


class _Strata:
    """Sums of squares of the effects, and their integrals on a grid of precisions."""

    def __init__(self, anova: AnovaResult, slopes: bool) -> None:
        # Orthonormal contrasts of each effect, by column.
        scores, columns = contrast_scores(anova.y)
        self.people, self.cells = scores.shape
        self.effects = [members for members in columns if members]
        self.slopes = slopes
        # In units of the total variance, so that the grid of precisions fits every scale.
        unit = float((scores**2).sum() / (scores.size - 1))
        if not unit > 0:
            raise InputError("the cell means do not vary, so there is no Bayes factor")
        squares = {members: scores[:, part] for members, part in columns.items()}
        self.of_people = float((scores[:, columns[()]] ** 2).sum()) / unit
        means = {m: part.mean(axis=0) for m, part in squares.items()}
        self.fixed = {m: self.people * float((means[m] ** 2).sum()) / unit for m in self.effects}
        self.error = {m: float(((squares[m] - means[m]) ** 2).sum()) / unit for m in self.effects}
        self.df = {m: squares[m].shape[1] for m in self.effects}
        sizes = anova.y.shape[1:]
        self.per_level = {m: self.cells / float(np.prod([sizes[k] for k in m])) for m in self.effects}
        # The highest interaction: its differences between people are the residual.
        residual = max(self.effects, key=len)
        if self.error[residual] <= 1e-12:
            raise InputError("participants are alike in every effect, so no residual is left to compare with")
        self.g, self.residual = np.exp(LOG_G), residual
        # precisions from that of all variation to that of the residual alone, and ten of its SDs beyond both
        n = scores.size - 1
        sd = float(np.sqrt(2 / n))
        end = float(np.log(n / min(self.error[residual], n))) + 10 * sd
        # A third of an SD apart: the integrand is far smoother.
        self.log_tau = np.arange(-10 * sd, end, sd / 3)
        self.tau = np.exp(self.log_tau)
        self.log_density = (n / 2 - 1) * self.log_tau

    def _prior(self, scale: float) -> Floats:
        """Log of the density of g times g, on its grid of logarithms."""
        density = np.log(scale) - 0.5 * np.log(2 * np.pi) - 1.5 * LOG_G - scale**2 / (2 * self.g)
        # A density over log g has the factor g; the last term is the width of a step.
        return np.asarray(density + LOG_G + np.log(LOG_G[1] - LOG_G[0]), dtype=np.float64)

    def participants(self) -> Floats:
        """Log h of participants' means (t,)."""
        shrunk = 1 + self.cells * self.g
        # One df less: the mean over all people belongs to the intercept.
        logs = self._prior(SCALE_RANDOM) - (self.people - 1) / 2 * np.log(shrunk)
        return _integrated(logs[None] - self.tau[:, None] / 2 * (self.of_people / shrunk))

    def block(self, effect: Members, is_fixed: bool) -> Floats:
        """Log h (t,) of an effect, with its participants' slopes where the model has them."""
        q, fixed, error = self.df[effect], self.fixed[effect], self.error[effect]
        n = self.people * self.per_level[effect]
        if not self.slopes or effect == self.residual:
            # the error is residual; its exponent has no other place
            plain = -self.tau / 2 * error
            if not is_fixed:
                return np.asarray(plain - self.tau / 2 * fixed, dtype=np.float64)
            shrunk = 1 + n * self.g
            logs = self._prior(SCALE_FIXED) - q / 2 * np.log(shrunk)
            whole: Floats = plain + _integrated(logs[None] - self.tau[:, None] / 2 * (fixed / shrunk))
            return whole
        of_slopes = 1 + self.per_level[effect] * self.g
        logs = self._prior(SCALE_RANDOM) - q * (self.people - 1) / 2 * np.log(of_slopes)
        if not is_fixed:
            logs = logs - q / 2 * np.log(of_slopes)
            return _integrated(logs[None] - self.tau[:, None] / 2 * ((error + fixed) / of_slopes))
        # Two variances at once, of the effect and of its slopes: a grid in two dimensions.
        both = of_slopes[:, None] + n * self.g[None]
        logs = logs[:, None] + self._prior(SCALE_FIXED)[None] - q / 2 * np.log(both)
        exponent = error / of_slopes[:, None] + fixed / both
        # A precision at a time: all at once would hold millions of numbers.
        return np.array([special.logsumexp(logs - tau / 2 * exponent) for tau in self.tau])


def _integrated(logs: Floats) -> Floats:
    return np.asarray(special.logsumexp(logs, axis=1), dtype=np.float64)
