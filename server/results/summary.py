"""Pure functions behind the results page: marginal means with within-participant error bars."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean


@dataclass(frozen=True)
class MarginMean:
    """Mean of one combination of levels; `se_within` is Cousineau-Morey, None for one participant."""

    levels: dict[str, str]
    mean: float
    se_within: float | None
    participants: int


CellMeans = Mapping[str, Mapping[tuple[str, ...], float]]
"""Participant -> (levels in factor order) -> mean rating."""


def margin(cell_means: CellMeans, factors: Sequence[str], keep: Sequence[str]) -> list[MarginMean]:
    """Marginal means of the factors in `keep`, over the participants who have every one of those levels.

    Cells of a participant are averaged without weights. Error bars follow Cousineau (2005) with Morey's
    (2008) correction: each participant's scores are centred on the grand mean, and the standard error is
    multiplied by sqrt(k / (k - 1)) for k conditions.
    """
    places = [factors.index(name) for name in keep]
    by_participant = {who: _collapse(cells, places) for who, cells in cell_means.items()}
    conditions = list(dict.fromkeys(key for row in by_participant.values() for key in row))
    rows = [
        [row[key] for key in conditions] for row in by_participant.values() if len(row) == len(conditions)
    ]
    if not rows:
        return []
    errors = _within_errors(rows)
    return [
        MarginMean(
            levels=dict(zip(keep, key, strict=True)),
            mean=fmean(row[place] for row in rows),
            se_within=errors[place] if errors else None,
            participants=len(rows),
        )
        for place, key in enumerate(conditions)
    ]


def _collapse(cells: Mapping[tuple[str, ...], float], places: Sequence[int]) -> dict[tuple[str, ...], float]:
    groups: dict[tuple[str, ...], list[float]] = defaultdict(list)
    for levels, mean in cells.items():
        groups[tuple(levels[place] for place in places)].append(mean)
    return {key: fmean(values) for key, values in groups.items()}


def _within_errors(rows: Sequence[Sequence[float]]) -> list[float] | None:
    people, conditions = len(rows), len(rows[0])
    if people < 2:
        return None
    grand = fmean(value for row in rows for value in row)
    centred = [[value - fmean(row) + grand for value in row] for row in rows]
    correction = math.sqrt(conditions / (conditions - 1)) if conditions > 1 else 1.0
    return [
        _sd([row[place] for row in centred]) / math.sqrt(people) * correction for place in range(conditions)
    ]


def _sd(values: Sequence[float]) -> float:
    mean = fmean(values)
    return math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))


def histogram(values: Iterable[float], edges: Sequence[float]) -> list[int]:
    """Counts of values in [edge, next edge); the last bin takes everything from its edge on."""
    counts = [0] * len(edges)
    for value in values:
        place = sum(value >= edge for edge in edges) - 1
        counts[max(place, 0)] += 1
    return counts
