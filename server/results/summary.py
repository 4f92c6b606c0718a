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
    groups: dict[tuple[tuple[str, ...], ...], Alike] = {}
    for means in cell_means.values():
        cells = tuple(means)
        if cells not in groups:
            groups[cells] = Alike(cells, [])
        groups[cells].rows.append(tuple(means.values()))
    return list(groups.values())


def margin(
    people: Sequence[Alike], factors: Sequence[str], keep: Sequence[str], between: Sequence[str] = ()
) -> list[MarginMean]:
    """Marginal means of the factors in `keep`, over the participants who have every one of those levels.

    Cells of a participant are averaged without weights. Error bars: `within_participant_errors`, each
    group for itself where `keep` has factors of `between`, of which a participant has one level or some.
    """
    fixed = [factors.index(name) for name in keep if name in between]
    groups: dict[tuple[str, ...], list[Alike]] = {}
    for those in people:
        for group, cells in _cells_by_group(those, fixed).items():
            groups.setdefault(group, []).append(_of_cells(those, cells))
    places = [factors.index(name) for name in keep]
    return [mean for group in groups.values() for mean in _of_group(group, keep, places)]


def _cells_by_group(those: Alike, fixed: Sequence[int]) -> dict[tuple[str, ...], list[int]]:
    """Which of their cells lie in each group, by its levels of the factors at `fixed`."""
    groups: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for number, levels in enumerate(those.cells):
        groups[tuple(levels[index] for index in fixed)].append(number)
    return groups


def _of_cells(those: Alike, cells: Sequence[int]) -> Alike:
    """The same participants with some of their cells."""
    if len(cells) == len(those.cells):
        return those
    rows = [tuple(row[number] for number in cells) for row in those.rows]
    return Alike(tuple(those.cells[number] for number in cells), rows)


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
            se_within=errors[index] if errors else None,
            participants=len(rows),
        )
        for index, (key, column) in enumerate(zip(conditions, zip(*rows, strict=True), strict=True))
    ]


def _collapse(those: Alike, places: Sequence[int]) -> dict[tuple[str, ...], Sequence[float]]:
    """Condition -> each participant's mean over the cells of that condition."""
    members: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for number, levels in enumerate(those.cells):
        members[tuple(levels[index] for index in places)].append(number)
    columns = list(zip(*those.rows, strict=True))
    return {
        key: columns[of[0]]
        if len(of) == 1
        else [sum(values) / len(of) for values in zip(*(columns[one] for one in of), strict=True)]
        for key, of in members.items()
    }
