"""Pure functions behind the results page: marginal means with within-participant error bars."""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

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


class Alike(NamedTuple):
    """Participants who rated the same cells: their means by cell, a row a participant."""

    cells: tuple[tuple[str, ...], ...]
    rows: list[tuple[float, ...]]


def alike(cell_means: CellMeans) -> list[Alike]:
    """Participants by the cells they rated. Thousands are then reckoned with column by column."""
    found: dict[tuple[tuple[str, ...], ...], Alike] = {}
    for means in cell_means.values():
        cells = tuple(means)
        if cells not in found:
            found[cells] = Alike(cells, [])
        found[cells].rows.append(tuple(means.values()))
    return list(found.values())


def margin(
    people: Sequence[Alike], factors: Sequence[str], keep: Sequence[str], between: Sequence[str] = ()
) -> list[MarginMean]:
    """Marginal means of the factors in `keep`, over the participants who have every one of those levels.

    Cells of a participant are averaged without weights. Error bars: `within_participant_errors`, each
    group for itself where `keep` has factors of `between`, of which a participant has one level.
    """
    fixed = [factors.index(name) for name in keep if name in between]
    groups: dict[tuple[str, ...], list[Alike]] = {}
    for those in people:
        for group in dict.fromkeys(tuple(levels[place] for place in fixed) for levels in those.cells):
            groups.setdefault(group, []).append(those)
    places = [factors.index(name) for name in keep]
    return [mean for group in groups.values() for mean in _of_group(group, keep, places)]


def _of_group(people: Sequence[Alike], keep: Sequence[str], places: Sequence[int]) -> list[MarginMean]:
    collapsed = [_collapse(those, places) for those in people]
    conditions = list(dict.fromkeys(key for columns in collapsed for key in columns))
    complete = [columns for columns in collapsed if len(columns) == len(conditions)]
    rows = [row for columns in complete for row in zip(*(columns[key] for key in conditions), strict=True)]
    if not rows:
        return []
    errors = within_participant_errors(rows)
    return [
        MarginMean(
            levels=dict(zip(keep, key, strict=True)),
            mean=math.fsum(column) / len(rows),
            se_within=errors[place] if errors else None,
            participants=len(rows),
        )
        for place, (key, column) in enumerate(zip(conditions, zip(*rows, strict=True), strict=True))
    ]


def _collapse(those: Alike, places: Sequence[int]) -> dict[tuple[str, ...], Sequence[float]]:
    """Condition -> each participant's mean over the cells of that condition."""
    members: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for number, levels in enumerate(those.cells):
        members[tuple(levels[place] for place in places)].append(number)
    columns = list(zip(*those.rows, strict=True))
    return {
        key: columns[of[0]]
        if len(of) == 1
        else [sum(values) / len(of) for values in zip(*(columns[one] for one in of), strict=True)]
        for key, of in members.items()
    }
