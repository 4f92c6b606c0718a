"""Linear estimates of the multivariate model: marginal means and contrasts of means, with their errors."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult
from analysis.within.strata import effect_name
from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Margin:
    """A margin of groups x within levels: what its means are linear in.

    `names` are its factors, between before within; `combinations` their levels, last fastest. `rows` (G, p)
    are the groups' design rows; `fitted` (p, W) the coefficients and `residual` (N, W) the residuals of the
    W within means; `unscaled` (p, p) is (X'X)^-1 and `df` the error df.
    """

    names: tuple[str, ...]
    combinations: tuple[dict[str, str], ...]
    rows: Floats = field(repr=False)
    fitted: Floats = field(repr=False)
    residual: Floats = field(repr=False)
    unscaled: Floats = field(repr=False)
    df: int

    @property
    def means(self) -> Floats:
        """Estimated means (G * W,) in the order of `combinations`."""
        return np.asarray(self.rows @ self.fitted).ravel()

    def contrasts(self, weights: Floats) -> tuple[Floats, Floats]:
        r"""Estimates (c,) and standard errors (c,) of contrasts `weights` (c, G * W).

        Notes
        -----
        With weights :math:`D` (G, W) of one contrast, group rows C and within means :math:`Y_M = X B + R`:
        estimate :math:`\mathrm{tr}(D' C B)`, variance
        :math:`\mathrm{sum}(C (X'X)^{-1} C' \circ T'T) / \nu`, :math:`T = R D'`. Differences are taken before
        squaring, so that nothing cancels.
        """
        grid = weights.reshape(len(weights), len(self.rows), -1)
        # `optimize` multiplies in the cheap order: without it the sum runs over all indices at once.
        estimates = np.einsum("cgw,gp,pw->c", grid, self.rows, self.fitted, optimize=True)
        spread = self.rows @ self.unscaled @ self.rows.T
        # Each participant's contrast per group: small where ratings are large and agree.
        turned = np.einsum("nw,cgw->cng", self.residual, grid, optimize=True)
        squares = np.einsum("cng,cnh->cgh", turned, turned, optimize=True)
        variance = np.einsum("gh,cgh->c", spread, squares) / self.df
        # Rounding may leave a variance just below 0.
        return estimates, np.sqrt(np.maximum(variance, 0.0))

    def tested(self, weights: Floats, scale: float) -> tuple[Floats, Floats, Floats]:
        """Estimates, standard errors and t of contrasts (each (c,)) of ratings as large as `scale`.

        An error that is only rounding is 0, and its t NaN: nobody differs.
        """
        estimates, errors = self.contrasts(weights)
        # Averages of N ratings are rounded to about eps of them; a standard error divides that by sqrt(N).
        rounding = 16 * np.finfo(float).eps * scale / np.sqrt(self.df + 1)
        errors = np.where(errors > rounding, errors, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return estimates, errors, np.where(errors > 0, estimates / errors, np.nan)


def margin_of(result: AnovaResult, names: Sequence[str]) -> Margin:
    """The margin of the factors `names` (any order): others are averaged over with equal weight.

    Raises
    ------
    InputError
        A name that is not a factor; covariates have no margin.
    """
    for name in names:
        if name not in result.all_factors:
            raise InputError(f"no factor is called '{name}'{did_you_mean(name, result.all_factors)}")
    groups = [k for k, name in enumerate(result.between.factors) if name in names]
    members = [m for m, name in enumerate(result.factors) if name in names]
    design = result.between
    rows = np.array(
        [
            design.row({design.factors[k]: code for k, code in zip(groups, at, strict=True)})
            for at in product(*(range(len(design.levels[k])) for k in groups))
        ]
    )
    away = tuple(axis + 1 for axis in range(len(result.factors)) if axis not in members)
    means = result.y.mean(axis=away).reshape(result.n_participants, -1)
    x = design.matrix
    # lstsq and not the normal equations: squaring X would lose digits of covariates with large means.
    fitted, *_ = np.linalg.lstsq(x, means, rcond=None)
    levels = [design.levels[k] for k in groups] + [result.levels[m] for m in members]
    ordered = (*(design.factors[k] for k in groups), *(result.factors[m] for m in members))
    return Margin(
        names=ordered,
        combinations=tuple(dict(zip(ordered, at, strict=True)) for at in product(*levels)),
        rows=rows,
        fitted=fitted,
        residual=means - x @ fitted,
        unscaled=np.asarray(np.linalg.inv(x.T @ x), dtype=np.float64),
        df=result.df_error,
    )


# Estimated marginal means with their errors.


@dataclass(frozen=True)
class MarginalMean:
    """Mean over participants of one margin's level, its SE and confidence interval on N - p df.

    `effect` names the margin; `levels` gives the level of each of its factors.
    """

    effect: str
    levels: dict[str, str]
    mean: float
    se: float
    ci: tuple[float, float]


def margin(result: AnovaResult, members: tuple[int, ...]) -> Floats:
    """Participants' means (N, levels of the margin) of the factors at `members`, last factor fastest."""
    away = tuple(axis + 1 for axis in range(len(result.factors)) if axis not in members)
    means: Floats = result.y.mean(axis=away).reshape(result.n_participants, -1)
    return means


def margins_shown(n_factors: int) -> list[tuple[int, ...]]:
    """Every margin of one and of two factors, then the cells."""
    if n_factors == 0:
        return []
    margins = [m for order in (1, 2) for m in combinations(range(n_factors), order)]
    cells = tuple(range(n_factors))
    # Cells of two factors are a margin already.
    return margins if cells in margins else [*margins, cells]


def marginal_means(result: AnovaResult, confidence: float = 0.95) -> tuple[MarginalMean, ...]:
    """Estimated marginal means of every margin of one and two factors and of the cells.

    Means of the multivariate linear model, groups and levels averaged over with equal weight, covariates at
    their mean; intervals from t on N - p df. With one group this is the mean of participants' marginal
    means with SE = sd / sqrt(N): SPSS's, and emmeans' with model = "multivariate".
    """
    names = result.all_factors
    return tuple(
        mean
        for members in margins_shown(len(names))
        for mean in means_of(margin_of(result, [names[m] for m in members]), confidence)
    )


def means_of(margin: Margin, confidence: float = 0.95) -> list[MarginalMean]:
    """The means of one margin."""
    means, errors = margin.contrasts(np.eye(len(margin.combinations)))
    reach = float(special.stdtrit(margin.df, 0.5 + confidence / 2))
    name = effect_name(margin.names)
    return [
        MarginalMean(name, levels, float(m), float(se), (float(m - reach * se), float(m + reach * se)))
        for levels, m, se in zip(margin.combinations, means, errors, strict=True)
    ]


def group_membership(result: AnovaResult, factors: Sequence[str]) -> Floats:
    """1 in the own group of a participant, NaN in others: (N, groups) of these factors between people."""
    design = result.between
    at = [design.factors.index(name) for name in factors]
    sizes = [len(design.levels[k]) for k in at]
    own = np.zeros(result.n_participants, np.int64)
    # Without factors between participants everyone is in the one group, 0.
    if at:
        own = np.ravel_multi_index(tuple(design.codes[:, k] for k in at), sizes).astype(np.int64)
    marks = np.full((result.n_participants, int(np.prod(sizes, initial=1))), np.nan)
    marks[np.arange(len(own)), own] = 1.0
    return marks
