"""Pure functions behind the results page: marginal means with within-participant error bars."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

from experiments.error_bars import within_participant_errors


@dataclass(frozen=True)
class MarginMean:
    """Mean of one combination of levels; `se_within` is Cousineau-Morey, None for one participant."""

    levels: dict[str, str]
    mean: float
    se_within: float | None
    participants: int


CellMeans = Mapping[str, Mapping[tuple[str, ...], float]]
"""Participant -> (levels in factor order) -> mean rating."""


def margin(
    cell_means: CellMeans, factors: Sequence[str], keep: Sequence[str], between: Sequence[str] = ()
) -> list[MarginMean]:
    """Marginal means of the factors in `keep`, over the participants who have every one of those levels.

    Cells of a participant are averaged without weights. Error bars: `within_participant_errors`, each
    group for itself where `keep` has factors of `between`, of which a participant has one level.
    """
    fixed = [factors.index(name) for name in keep if name in between]
    groups: dict[tuple[str, ...], dict[str, Mapping[tuple[str, ...], float]]] = {}
    for who, cells in cell_means.items():
        for group in dict.fromkeys(tuple(levels[place] for place in fixed) for levels in cells):
            groups.setdefault(group, {})[who] = cells
    return [mean for people in groups.values() for mean in _of_group(people, factors, keep)]


def _of_group(cell_means: CellMeans, factors: Sequence[str], keep: Sequence[str]) -> list[MarginMean]:
    places = [factors.index(name) for name in keep]
    by_participant = {who: _collapse(cells, places) for who, cells in cell_means.items()}
    conditions = list(dict.fromkeys(key for row in by_participant.values() for key in row))
    rows = [
        [row[key] for key in conditions] for row in by_participant.values() if len(row) == len(conditions)
    ]
    if not rows:
        return []
    errors = within_participant_errors(rows)
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


def histogram(values: Iterable[float], edges: Sequence[float]) -> list[int]:
    """Counts of values in [edge, next edge); the last bin takes everything from its edge on."""
    counts = [0] * len(edges)
    for value in values:
        place = sum(value >= edge for edge in edges) - 1
        counts[max(place, 0)] += 1
    return counts
