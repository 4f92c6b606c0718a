"""What a fitted cumulative-link mixed model says: coefficients, tests, SDs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.models.design import ModelData
from analysis.models.ordinal_data import Parameters
from analysis.models.ordinal_maximum import SD_MAX, Maximum
from analysis.models.roles import Slopes

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class OrdinalEffect:
    """Joint Wald test that all coefficients of an effect are zero."""

    effect: str
    chi2: float
    df: int
    p_value: float


@dataclass(frozen=True)
class OrdinalCoefficient:
    """A sum-coded coefficient on the logit scale with its Wald test."""

    name: str
    estimate: float
    se: float
    z: float
    p_value: float


@dataclass(frozen=True)
class OrdinalComponent:
    """Standard deviation, on the logit scale, of a random term; a slope's is over unit-variance contrasts."""

    group: str
    term: str
    sd: float


@dataclass(frozen=True)
class OrdinalResult:
    """A fitted cumulative-link mixed model; `thresholds[k]` lies between categories k and k + 1.

    Attributes
    ----------
    singular : bool
        The SD of a random term is estimated as zero.
    quadrature : int
        Nodes of each participant's integral; 1 is Laplace's approximation.
    """

    formula: str
    log_likelihood: float
    aic: float
    categories: tuple[float, ...]
    thresholds: tuple[float, ...]
    coefficients: tuple[OrdinalCoefficient, ...]
    effects: tuple[OrdinalEffect, ...]
    sd_participant: float
    sd_item: float
    slopes: Slopes
    components: tuple[OrdinalComponent, ...]
    singular: bool
    n_ratings: int
    n_participants: int
    n_items: int
    notes: tuple[str, ...] = ()
    factors: tuple[str, ...] = ()
    quadrature: int = 1


@dataclass(frozen=True)
class RandomTerms:
    """The effects that differ between participants."""

    slopes: Slopes
    groups: tuple[str, ...]


def ordinal_result(
    data: ModelData,
    categories: Floats,
    maximum: Maximum,
    terms: RandomTerms,
    left_out: Sequence[str],
    quadrature: int,
) -> OrdinalResult:
    """Coefficients, joint tests and SDs at the maximum; notes of what was left out precede its own."""
    p = maximum.parameters
    first = len(p.thresholds)
    block = maximum.covariance[first : -len(p.sd), first : -len(p.sd)]
    components = _components(p, terms, data)
    parameters = first + len(p.beta) + len(components)
    return OrdinalResult(
        formula=_formula(data, terms),
        log_likelihood=maximum.value,
        aic=2 * parameters - 2 * maximum.value,
        categories=tuple(float(c) for c in categories),
        thresholds=tuple(float(t) for t in p.thresholds),
        coefficients=_coefficients(data, p.beta, block),
        effects=_effects(data, p.beta, block),
        sd_participant=components[0].sd,
        sd_item=components[-1].sd if data.items else 0.0,
        slopes=terms.slopes,
        components=components,
        singular=any(component.sd == 0 for component in components),
        n_ratings=len(data.rating),
        n_participants=len(data.participants.names),
        n_items=len(data.items.names) if data.items else 0,
        notes=(*data.notes, *left_out, *_search_notes(maximum), *_sd_notes(p, terms, data)),
        factors=data.factors,
        quadrature=quadrature,
    )


def _coefficients(data: ModelData, beta: Floats, covariance: Floats) -> tuple[OrdinalCoefficient, ...]:
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return tuple(
        OrdinalCoefficient(name, float(b), float(s), float(b / s), float(2 * special.ndtr(-abs(b / s))))
        for name, b, s in zip(data.column_names[1:], beta, se, strict=True)
    )


def _effects(data: ModelData, beta: Floats, covariance: Floats) -> tuple[OrdinalEffect, ...]:
    effects = []
    for effect in data.effects:
        columns = data.columns(effect) - 1
        chi2 = float(beta[columns] @ np.linalg.solve(covariance[np.ix_(columns, columns)], beta[columns]))
        effects.append(OrdinalEffect(effect, chi2, len(columns), float(special.chdtrc(len(columns), chi2))))
    return tuple(effects)


def _search_notes(maximum: Maximum) -> tuple[str, ...]:
    if maximum.settled:
        return ()
    return ("the likelihood still rises where the search ended: it may have no finite maximum (separation)",)


def _sd_notes(p: Parameters, terms: RandomTerms, data: ModelData) -> list[str]:
    names = ["participants", *(f"participants' slopes of {group}" for group in terms.groups[1:])]
    names += ["items"] * (data.items is not None)
    zero = "the SD of {} is estimated as zero"
    limit = (
        "the SD of {} is at its upper limit of {:.1f}: the ratings hardly bound it, and with it the estimates"
    )
    return [
        zero.format(name) if sd == 0 else limit.format(name, SD_MAX)
        for name, sd in zip(names, p.sd, strict=False)
        if sd == 0 or sd > SD_MAX - 1e-6
    ]


def _components(p: Parameters, terms: RandomTerms, data: ModelData) -> tuple[OrdinalComponent, ...]:
    components = [
        OrdinalComponent(data.terms.participant, group, float(sd) / data.unit(group))
        for group, sd in zip(terms.groups, p.sd[:-1], strict=True)
    ]
    if data.items is not None:
        components.append(OrdinalComponent(data.items.name, "intercept", float(p.sd[-1])))
    return tuple(components)


def _formula(data: ModelData, terms: RandomTerms) -> str:
    participant = data.terms.participant
    slopes = "".join(f" + (0 + {group} | {participant})" for group in terms.groups[1:])
    items = f" + (1 | {data.items.name})" if data.items else ""
    return f"{data.terms.rating} ~ {data.fixed_part} + (1 | {participant}){slopes}{items}, logit"
