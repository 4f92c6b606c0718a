"""What the columns of a table are in a mixed or ordinal model, and who may differ in effects."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from experiments.errors import InputError

Slopes = Literal["none", "main", "all", "correlated"]
RandomSlopes = Literal["none", "main", "all"]


@dataclass(frozen=True)
class ModelTerms:
    """What a model is of: columns by their role.

    `within` vary within participants, `between` do not; `item` (several columns together) names what was
    rated; `covariates` are numbers, centred; `interactions` are products of covariates with covariates or
    factors, by the names of their members; `random` are further groupings with an intercept each, `a/b` for
    b nested in a.
    """

    participant: str
    rating: str
    within: tuple[str, ...]
    item: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    covariates: tuple[str, ...] = ()
    random: tuple[str, ...] = ()
    interactions: tuple[tuple[str, ...], ...] = ()


def split_covariates(
    named: Sequence[str], factors: Sequence[str]
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Covariates, and their interactions: of `Days`, `age:group` the covariates are Days and age.

    Parameters
    ----------
    named : sequence of str
        Columns of numbers, and interactions whose members are separated by colons.
    factors : sequence of str
        Columns of factors; what else an interaction names is a covariate, with a slope in the model.

    Raises
    ------
    InputError
        An interaction of factors alone (which the model always has), or with one member twice.
    """
    covariates: dict[str, None] = dict.fromkeys(name for name in named if ":" not in name)
    interactions: dict[tuple[str, ...], None] = {}
    for name in named:
        if ":" not in name:
            continue
        members = tuple(part.strip() for part in name.split(":"))
        numbers = [member for member in members if member not in factors]
        if not numbers:
            raise InputError(
                f"'{name}' names factors alone, whose interactions are always in the model; expected an "
                "interaction with a covariate, such as age:blur"
            )
        if len(set(members)) < len(members) or "" in members:
            raise InputError(f"expected an interaction of different columns, got '{name}'")
        covariates |= dict.fromkeys(numbers)
        interactions[members] = None
    return tuple(covariates), tuple(interactions)
