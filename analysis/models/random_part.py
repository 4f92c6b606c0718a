"""The random part of a mixed model: words, standard deviations, and what the ratings do not tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.models.columns import Grouping
from analysis.models.design import ModelData
from analysis.models.roles import RandomSlopes, Slopes
from analysis.models.satterthwaite import Uncertainty
from analysis.models.variances import SINGULAR_THETA
from experiments.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Component:
    """Standard deviation of a random term; `correlations` with the group's earlier terms, where estimated.

    `ci` is its profile likelihood interval, where asked for and where it is a parameter of its own.
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


def untold(known: Uncertainty, names: list[str]) -> tuple[str, ...]:
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
            f"the ratings do not tell apart the variances of {told} and of the residual; those printed are "
            "one choice of many, the tests are the same with all of them",
        )
    raise InputError(
        f"the ratings do not tell how large the variance of {told} is, and the tests depend on it; expected "
        "each of its levels in more than one condition, or several of its levels in each, with more than one "
        "rating; collect such ratings, or leave the grouping out"
    )


def degenerate_terms(
    components: tuple[Component, ...], factor: Floats, sigma: float, data: ModelData
) -> tuple[str, ...]:
    """What a singular fit says: which variances are zero, or that random terms depend on one another."""
    zero = [f"{c.group} {c.term}" for c in components if c.sd * data.unit(c.term) < SINGULAR_THETA * sigma]
    if zero:
        return (
            f"singular fit: the variance of {', '.join(zero)} is estimated as zero; these terms are kept at "
            "zero, which leaves the tests of other effects as they are",
        )
    if np.linalg.svd(factor, compute_uv=False).min() < SINGULAR_THETA:
        return ("singular fit: the random terms of participants depend on one another (a correlation of 1)",)
    return ()


def terms_of(data: ModelData, group: Grouping, slopes: RandomSlopes) -> list[str]:
    """What differs between the levels of a further grouping, `intercept` first."""
    sloped = slopes != "none" and data.has_slopes(group)
    return data.random_effects(slopes) if sloped else ["intercept"]


def formula_of(data: ModelData, labels: list[str], slopes: Slopes, random_slopes: RandomSlopes) -> str:
    """The model as R writes it."""
    person = data.terms.participant
    shared = labels if slopes == "correlated" else data.correlated_effects(labels)
    rest = [label for label in labels if label not in shared]
    parts = [f"({_in_formula(shared)} | {person})"] if shared else []
    if rest:
        parts.append(f"({'0 + ' if shared else ''}{_in_formula(rest)} || {person})")
    of_people = " + ".join(parts)
    others = ""
    for group in data.groups[1:]:
        terms = terms_of(data, group, random_slopes)
        others += f" + ({_in_formula(terms)} {'||' if len(terms) > 1 else '|'} {group.name})"
    return f"{data.terms.rating} ~ {data.fixed_part} + {of_people}{others}"


def _in_formula(labels: Sequence[str]) -> str:
    return " + ".join("1" if label == "intercept" else label for label in labels)


def components_of_people(
    labels: list[str], factor: Floats, sigma: float, slopes: Slopes, data: ModelData
) -> list[Component]:
    """Standard deviations of participants' terms, from the factor of their covariance over sigma squared."""
    participant = data.terms.participant
    covariance = sigma**2 * factor @ factor.T
    sds = np.sqrt(np.diag(covariance))
    of_column = [label for label in labels for _ in data.columns(label)]
    sds = sds / [data.unit(label) for label in of_column]
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
