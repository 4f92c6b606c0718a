"""What the columns of a table are in a mixed or ordinal model, and who may differ in effects."""

from dataclasses import dataclass
from typing import Literal

Slopes = Literal["none", "main", "all", "correlated"]
RandomSlopes = Literal["none", "main", "all"]


@dataclass(frozen=True)
class ModelTerms:
    """What a model is of: columns by their role.

    `within` vary within participants, `between` do not; `item` (several columns together) names what was
    rated; `covariates` are numbers, centred; `random` are further groupings with an intercept each, `a/b` for
    b nested in a.
    """

    participant: str
    rating: str
    within: tuple[str, ...]
    item: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    covariates: tuple[str, ...] = ()
    random: tuple[str, ...] = ()
