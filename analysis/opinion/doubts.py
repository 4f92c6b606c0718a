"""What must be said of recovered scores: who told nothing of them, and what has no common scale."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.opinion.projection import Projection

NAMED_MAX = 6


def doubts(model: Projection, people: Sequence[str], items: Sequence[str]) -> Iterator[str]:
    """Decisions on the model of votes by the people and items named, in words."""
    if (alone := model.person_groups < 0).any():
        counts = "counts" if alone.sum() == 1 else "count"
        yield f"one vote tells no bias: {_named(people, alone)} {counts} in MOS, but not in recovered scores"
    if (lacking := model.groups < 0).any():
        yield f"only people of one vote rated {_named(items, lacking)}: no recovered score"
    if model.held.any():
        yield (
            f"the inconsistency of {_named(people, model.held)} fell to nothing, so that the scores would be "
            "theirs alone: weighted by the common one"
        )
    if (number := int(model.groups.max()) + 1) > 1:
        told = " | ".join(_named(items, model.groups == group) for group in range(min(number, NAMED_MAX)))
        more = f" and {number - NAMED_MAX} more" if number > NAMED_MAX else ""
        yield (
            f"the items fall into {number} groups that no person rated across ({told}{more}): scores and "
            "biases of one group cannot be compared with those of another, whose people may be more lenient"
        )
    if not model.converged:
        yield f"recovered scores still moved after {model.iterations} rounds: too few people join the items"


def _named(names: Sequence[str], which: NDArray[np.bool_]) -> str:
    chosen = [name for name, one in zip(names, which, strict=True) if one]
    rest = len(chosen) - NAMED_MAX
    return ", ".join(chosen[:NAMED_MAX]) + (f" and {rest} more" if rest > 0 else "")
