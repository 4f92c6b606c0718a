"""Whether comparisons tie all items together, and whether each has won and lost enough to be placed."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from analysis.pairs.comparisons import LEFT, RIGHT, Comparisons
from experiments.errors import InputError

NAMED_MAX = 6


def refuse_disconnected(comparisons: Comparisons) -> None:
    """Refuse items that no chain of comparisons joins: their abilities have no common scale.

    Raises
    ------
    InputError
    """
    groups = _components(comparisons, strong=False)
    if len(groups) > 1:
        told = " | ".join(_named(group) for group in groups[:NAMED_MAX])
        raise InputError(
            f"{comparisons.source}: the items fall into {len(groups)} groups that were never compared: "
            f"{told}; compare some across, or analyse each group by itself"
        )


def separated(comparisons: Comparisons) -> str | None:
    """Say which items won (or lost) every comparison with the rest; None where none did.

    Ford (1957), American Mathematical Monthly 64(8), 28: the maximum exists if and only if, however the
    items are parted in two, each part won at least once against the other; a tie counts for both.
    """
    groups = _components(comparisons, strong=True)
    if len(groups) == 1:
        return None
    wins = _wins(comparisons)
    position = {item: index for index, item in enumerate(comparisons.items)}
    for group in sorted(groups, key=len):
        inside = np.zeros(len(comparisons.items), dtype=bool)
        inside[[position[item] for item in group]] = True
        lost, won = wins[~inside][:, inside].sum(), wins[inside][:, ~inside].sum()
        if won and not lost:
            return f"{_named(group)} won every comparison with the others"
        if lost and not won:
            return f"{_named(group)} lost every comparison with the others"
    return f"{_named(groups[0])} won or lost every comparison with the others"


def _wins(comparisons: Comparisons) -> np.ndarray:
    """(k, k): how often the row's item won against the column's, ties for both."""
    wins = np.zeros((len(comparisons.items),) * 2, dtype=np.int64)
    for_left, for_right = comparisons.outcome != RIGHT, comparisons.outcome != LEFT
    np.add.at(wins, (comparisons.left[for_left], comparisons.right[for_left]), 1)
    np.add.at(wins, (comparisons.right[for_right], comparisons.left[for_right]), 1)
    return wins


def _components(comparisons: Comparisons, *, strong: bool) -> list[list[str]]:
    graph = coo_array(_wins(comparisons))
    count, labels = connected_components(graph, directed=True, connection="strong" if strong else "weak")
    names = np.array(comparisons.items, dtype=object)
    return [list(names[labels == label]) for label in range(count)]


def _named(items: list[str]) -> str:
    rest = len(items) - NAMED_MAX
    return ", ".join(items[:NAMED_MAX]) + (f" and {rest} more" if rest > 0 else "")
