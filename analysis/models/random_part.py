"""The random part of a mixed model: words, standard deviations, and what the ratings do not determine."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize

from analysis.models.columns import Grouping, RandomSlopes, Slopes
from analysis.models.design import ModelData
from analysis.models.fixed_effect_tests import Uncertainty
from analysis.models.formula import formula_name
from analysis.models.means import ModelMeans, RatioTest
from analysis.models.reml import CrossProducts, criterion
from analysis.models.residuals import ResidualChecks
from experiments.errors import InputError

# Relative standard deviations that minimize the criterion of a mixed model.

Floats = NDArray[np.float64]

ZERO_THETA = 1e-4
"""A relative SD below this is tried at zero, its bound."""

SINGULAR_THETA = 1e-4
"""A standard deviation below this share of the residual's counts as zero."""

START = 0.4
"""Relative standard deviation to start from."""

LIFTS = (0.003, 0.01, 0.03, 0.1, 0.3)

ROUGHLY = 1e-5
"""The descent ends where a step lowers the criterion by less than this; Newton steps go on from there."""

NEWTON_STEPS = 8

NEWTON_DECREMENT = 1e-8
"""A step that promised less than this of the criterion was the last."""


def fit_theta(c: CrossProducts) -> Floats:
    """Minimize; a theta that ended at zero, always stationary, is lifted where zero is not a minimum."""
    # theta on the diagonal of a factor cannot be negative
    bounded = [bool(np.trace(pattern) > 0) for block in c.blocks for pattern in block.patterns]
    theta = _descend(c, np.where(bounded, START, 0.0), bounded, ROUGHLY)
    for _ in range(len(bounded)):
        lifted = _lifted(c, theta, bounded)
        if lifted is None:
            break
        theta = _descend(c, lifted, bounded, ROUGHLY)
    theta, settled = _polished(c, _zeroed(c, theta, bounded), bounded)
    if not settled:
        theta, _ = _polished(c, _zeroed(c, _descend(c, theta, bounded, 0.0), bounded), bounded)
    return theta


def _descend(c: CrossProducts, start: Floats, bounded: list[bool], least_fall: float) -> Floats:
    # The tolerance of L-BFGS-B is relative to the size of the criterion; `least_fall` is not.
    least = max(1e-14, least_fall / max(1.0, abs(criterion(c, start).value)))

    def objective(theta: Floats) -> tuple[float, Floats]:
        at = criterion(c, theta)
        return at.value, at.gradient

    optimum = optimize.minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, None) if b else (None, None) for b in bounded],
        options={"maxiter": 1000, "maxfun": 3000, "ftol": least, "gtol": 1e-8, "maxcor": 30},
    )
    return np.asarray(optimum.x, dtype=np.float64)


def _lifted(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats | None:
    """Theta with one entry lifted from zero where that lowers the criterion, else None."""
    at = criterion(c, theta)
    # The gradient at zero is zero whatever the data are: only the curvature shows a way down.
    for k in np.flatnonzero((np.abs(theta) < ZERO_THETA) & np.array(bounded) & (at.curve_at_zero < 0)):
        trials = np.repeat(theta[None], len(LIFTS), axis=0)
        trials[:, k] = LIFTS
        values = [criterion(c, trial).value for trial in trials]
        if min(values) < at.value - 1e-9:
            return np.asarray(trials[int(np.argmin(values))], dtype=np.float64)
    return None


def _zeroed(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats:
    """Put tiny standard deviations at zero where that is not worse."""
    for k in np.flatnonzero((np.abs(theta) < ZERO_THETA) & np.array(bounded)):
        trial = theta.copy()
        trial[k] = 0.0
        if criterion(c, trial).value <= criterion(c, theta).value + 1e-9:
            theta = trial
    return theta


def _polished(c: CrossProducts, theta: Floats, bounded: list[bool]) -> tuple[Floats, bool]:
    """Newton steps on the free theta, with the Hessian from differences of the exact gradient.

    Also whether they arrived.
    """
    at = criterion(c, theta)
    for _ in range(NEWTON_STEPS):
        free = np.flatnonzero(np.abs(theta) > 0)
        if len(free) == 0 or np.abs(at.gradient[free]).max() < 1e-9:
            return theta, True
        hessian = np.stack([_gradient_slope(c, theta, at.gradient, int(k))[free] for k in free])
        values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
        # Not a minimum, or level in some direction: a Newton step would lead anywhere.
        if values.min() <= 1e-8 * values.max():
            break
        rotated = vectors.T @ at.gradient[free]
        trial = theta.copy()
        trial[free] -= vectors @ (rotated / values)
        # Across a bound: the descent, which knows bounds, has to go on from here.
        if (trial[np.array(bounded)] < 0).any():
            break
        after = criterion(c, trial)
        # Written so that NaN ends the steps too.
        if not after.value < at.value + 1e-10 * abs(at.value):
            break
        theta, at = trial, after
        if float(rotated @ (rotated / values)) < NEWTON_DECREMENT:
            return theta, True
    return theta, False


def _gradient_slope(c: CrossProducts, theta: Floats, gradient: Floats, k: int) -> Floats:
    step = 1e-5 * max(abs(float(theta[k])), 0.05)
    moved = theta.copy()
    moved[k] += step
    return (criterion(c, moved).gradient - gradient) / step


@dataclass(frozen=True)
class Component:
    """Standard deviation of a random term; `correlations` with the group's earlier terms, where estimated.

    `ci` is its profile likelihood interval, where requested and where it is a separate parameter.
    """

    group: str
    term: str
    sd: float
    correlations: tuple[float, ...] = ()
    ci: tuple[float, float] | None = None


def theta_names(
    data: ModelData, labels: list[str], slopes: Slopes, random_slopes: RandomSlopes, own: int
) -> list[str]:
    """The random term of each theta, `own` of which are the participants'."""
    names = [f"{data.terms.participant} {label}" for label in labels]
    names += [data.terms.participant] * (own - len(names))
    if slopes == "correlated":
        names = [data.terms.participant] * own
    return names + [
        f"{group.name} {term}" for group in data.groups[1:] for term in terms_of(data, group, random_slopes)
    ]


def indistinct_variances_note(known: Uncertainty, names: list[str]) -> tuple[str, ...]:
    """What is said of variances that any share of another explains as well.

    Raises
    ------
    InputError
        The tests depend on the share.
    """
    if not known.level.size:
        return ()
    told = ", ".join(dict.fromkeys(names[k] for k in known.untold))
    if known.settled:
        return (
            f"the ratings cannot separate the variances of {told} and of the residual; the printed ones are "
            "one choice of many, and the tests are the same for all",
        )
    raise InputError(
        f"the ratings do not determine the variance of {told}, and the tests depend on it. Each of its "
        "levels should be in several conditions, or each condition should have several of its levels, with "
        "more than one rating. Collect such ratings, or remove the grouping"
    )


def degenerate_terms(
    components: tuple[Component, ...],
    factor: Floats,
    sigma: float,
    data: ModelData,
    effects: Sequence["MixedEffect"],
) -> tuple[str, ...]:
    """What a singular fit says: which variances are zero, or that random terms depend on one another."""
    zero = [c for c in components if c.sd * data.unit(c.term) < SINGULAR_THETA * sigma]
    df = {effect.effect: effect.df_error for effect in effects}
    said = [
        f"singular fit: the slope variance of {c.group} {c.term} is estimated as zero, so that the test of "
        f"{c.term} is against {_error_without(c, components, data)} (df = {df[c.term]:.1f})"
        for c in zero
        if c.term in df
    ]
    if rest := [f"{c.group} {c.term}" for c in zero if c.term not in df]:
        said.append(
            f"singular fit: the variance of {', '.join(rest)} is estimated as zero; these terms stay at "
            "zero, which does not affect the tests of other effects"
        )
    if said:
        return tuple(said)
    if np.linalg.svd(factor, compute_uv=False).min() < SINGULAR_THETA:
        return ("singular fit: the random terms of participants depend on one another (a correlation of 1)",)
    return ()


def _error_without(slope: Component, components: tuple[Component, ...], data: ModelData) -> str:
    """What an effect is tested against where one of its slopes has no variance."""
    columns = pd.DataFrame(data.slope_columns([slope.term]))
    for group in data.groups[1:]:
        own = [c for c in components if c.group == group.name and c.sd > 0]
        # An intercept counts where levels of the grouping have different values of the effect.
        means = columns.groupby(group.codes).mean()
        between = bool((np.ptp(means.to_numpy(), axis=0) > 1e-9).any())
        if any(c.term == slope.term or (between and c.term == "intercept") for c in own):
            return "the remaining random terms and the residual"
    return "the residual"


def terms_of(data: ModelData, group: Grouping, slopes: RandomSlopes) -> list[str]:
    """What differs between the levels of a further grouping, `intercept` first."""
    return data.group_effects(group, slopes)


def formula_of(data: ModelData, labels: list[str], slopes: Slopes, random_slopes: RandomSlopes) -> str:
    """The model as `--formula` reads it."""
    person = formula_name(data.terms.participant)
    shared = labels if slopes == "correlated" else data.correlated_effects(labels)
    rest = [label for label in labels if label not in shared]
    parts = [random_bracket(data, shared, "|", person)] if shared else []
    if shared and rest:
        parts.append(f"(0 + {' + '.join(map(data.in_formula, rest))} || {person})")
    elif rest:
        parts.append(random_bracket(data, rest, "||", person))
    parts += [
        random_bracket(data, terms_of(data, group, random_slopes), "||", group_in_formula(group))
        for group in data.groups[1:]
    ]
    return f"{formula_name(data.terms.rating)} ~ {data.fixed_part} + {' + '.join(parts)}"


def random_bracket(data: ModelData, labels: Sequence[str], bars: str, grouping: str) -> str:
    """A grouping with its intercept and slopes: (1 + a || clip), or (1 | clip) without slopes."""
    return f"({' + '.join(map(data.in_formula, labels))} {bars if len(labels) > 1 else '|'} {grouping})"


def group_in_formula(group: Grouping) -> str:
    """The columns of a grouping as a formula names them."""
    return ":".join(map(formula_name, group.columns))


def components_of_people(
    labels: list[str], factor: Floats, sigma: float, slopes: Slopes, data: ModelData
) -> list[Component]:
    """Standard deviations of participants' terms, from the factor of their covariance over sigma squared."""
    participant = data.terms.participant
    covariance = sigma**2 * factor @ factor.T
    sds = np.sqrt(np.diag(covariance))
    of_column = [label for label in labels for _ in data.columns(label)]
    sds = sds / [data.unit(label) for label in of_column]
    # A variance of zero has no correlation: NaN is meant.
    with np.errstate(invalid="ignore", divide="ignore"):
        roots = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(roots, roots)
    if slopes != "correlated":
        first = [of_column.index(label) for label in labels]
        shared = data.correlated_effects(labels)
        return [
            Component(
                participant,
                label,
                float(sds[i]),
                tuple(float(r) for r in correlation[i, :i]) if label in shared else (),
            )
            for label, i in zip(labels, first, strict=True)
        ]
    return [
        Component(participant, name, float(sds[i]), tuple(float(r) for r in correlation[i, :i]))
        for i, name in enumerate(_told_apart(of_column))
    ]


def _told_apart(labels: Sequence[str]) -> list[str]:
    """Labels of a factor's several contrasts numbered from 1; others as they are."""
    seen: dict[str, int] = {}
    names = []
    for label in labels:
        seen[label] = seen.get(label, 0) + 1
        names.append(f"{label} contrast {seen[label]}" if labels.count(label) > 1 else label)
    return names


# What a fitted linear mixed model says: tests, coefficients, components.

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
    means: ModelMeans | None = None
    ratio_tests: tuple[RatioTest, ...] = ()
    residuals: ResidualChecks | None = None


# Which effects participants may differ in.


def slope_groups(data: ModelData, slopes: Slopes) -> tuple[list[str], list[str]]:
    """Effects with a by-participant slope (`intercept` first), and what had to be left out.

    Raises
    ------
    InputError
        More correlated coefficients than ratings or participants determine; a slope that is asked for by name
        and that the ratings do not determine.
    """
    if data.terms.slope_effects:
        return _named_slopes(data, slopes)
    if slopes == "none":
        return ["intercept"], []
    if slopes != "all":
        effects = ["intercept", *data.covariate_slopes, *data.terms.within]
        if slopes == "correlated":
            _refuse_too_few(data, effects)
            return effects, _many_covariances(data, effects)
        return _without_residual_slopes(data, effects)
    inside = data.slope_effects
    kept, said = _without_residual_slopes(data, ["intercept", *_without_last(data, inside)])
    last = [effect for effect in inside if effect not in _without_last(data, inside)]
    return kept, [
        *(f"no slope of {name}: with one rating per cell it is the residual" for name in last),
        *said,
    ]


def _named_slopes(data: ModelData, slopes: Slopes) -> tuple[list[str], list[str]]:
    """The slopes that a formula names, or one line on the first that the ratings do not determine."""
    known = {frozenset(name.split(":")): name for name in data.effects}
    named = [known[frozenset(name.split(":"))] for name in data.terms.slope_effects or ()]
    participant = data.terms.participant
    for name in named:
        if name not in data.slope_effects:
            raise InputError(
                f"the slope of {name} by {participant} is not determined: it does not vary within one "
                f"{participant}; write it outside the brackets only"
            )
        if name not in _without_last(data, data.slope_effects):
            raise InputError(
                f"the slope of {name} by {participant} is not determined: with one rating per cell it is the "
                "residual; remove it"
            )
    effects = ["intercept", *named]
    if slopes == "correlated":
        _refuse_too_few(data, effects)
        return effects, _many_covariances(data, effects)
    kept, said = _without_residual_slopes(data, effects)
    if said:
        raise InputError(f"{said[0].replace('no slope', 'the slope')}; remove it")
    return kept, []


def refuse_group_slopes(data: ModelData) -> None:
    """Refuse slopes of further groupings that the ratings do not determine."""
    for group in data.groups[1:]:
        effects = data.group_effects(group, "none")[1:]
        for effect in effects:
            columns = pd.DataFrame(data.slope_columns([effect]))
            # Variation within at least two groups: one alone gives no variance of slopes.
            spread = columns.groupby(group.codes).std(ddof=0).max(axis=1)
            if int((spread > 1e-9).sum()) < 2:
                raise InputError(
                    f"the slope of {effect} by {group.name} is not determined: it does not vary within one "
                    f"{group.name}; write it outside the brackets only"
                )
        own = 1 + sum(len(data.columns(effect)) for effect in effects)
        # As many coefficients as ratings would leave no residual to test against.
        if effects and own * len(group.names) >= len(data.rating):
            raise InputError(
                f"the slopes by {group.name} are not determined: they have {own * len(group.names)} "
                f"coefficients, expected fewer than the {len(data.rating)} ratings; remove one"
            )


def _many_covariances(data: ModelData, effects: Sequence[str]) -> list[str]:
    """What is said of a covariance matrix that few participants hardly determine."""
    own, people = sum(len(data.columns(effect)) for effect in effects), len(data.participants.names)
    if own * (own + 1) // 2 <= people:
        return []
    return [
        f"{own * (own + 1) // 2} variances and covariances are estimated from {people} participants, who "
        "hardly determine them; slopes that do not correlate (||, or --slopes all) need fewer"
    ]


def _without_last(data: ModelData, inside: list[str]) -> list[str]:
    """Effects without the highest interaction of factors where each cell has one rating of a participant."""
    # One number for each pair of participant and cell.
    cells, people = len(data.fixed), data.participants
    counts = np.bincount(people.codes * cells + data.cell, minlength=len(people.names) * cells)
    of_factors = [effect for effect in inside if effect in data.factorial_effects]
    if counts.max() > 1 or not of_factors:
        return inside
    return [effect for effect in inside if effect != of_factors[-1]]


def _without_residual_slopes(data: ModelData, effects: list[str]) -> tuple[list[str], list[str]]:
    """Effects without slopes of covariates that would leave participants' ratings no residual."""
    people, ratings = len(data.participants.names), len(data.rating)
    numbers = {effect.name for effect in data.number_effects}
    kept, said = list(effects), []
    # From the last on: interactions of covariates give way before the covariates themselves.
    for name in reversed([effect for effect in effects if effect in numbers]):
        own = sum(len(data.columns(effect)) for effect in kept)
        if own * people < ratings:
            break
        kept.remove(name)
        said.append(f"no slope of {name}: with so few ratings of each participant it is the residual")
    return kept, said


def _refuse_too_few(data: ModelData, effects: Sequence[str]) -> None:
    """As many correlated random coefficients as ratings leave no residual."""
    own = sum(len(data.columns(effect)) for effect in effects)
    people, ratings = len(data.participants.names), len(data.rating)
    if own >= people:
        raise InputError(
            f"{people} participants do not determine the covariances of {own} correlated coefficients; use "
            "--slopes all or none, or || in a formula"
        )
    if own * people >= ratings:
        raise InputError(
            f"expected more than {own * people} ratings for {own} correlated coefficients of each of "
            f"{people} participants, got {ratings}. With one rating per cell, use --slopes none or all"
        )


def unmodelled_slopes(data: ModelData, slopes: Slopes) -> list[str]:
    """What is said of covariates that vary within participants, in a model of intercepts alone."""
    if slopes != "none" or not data.covariate_slopes:
        return []
    named = ", ".join(data.covariate_slopes)
    return [
        f"{named} varies within participants and has no by-participant slope: if people differ in it, its p "
        "is too small; add --slopes all"
    ]
