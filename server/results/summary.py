"""Pure functions behind the results page: marginal means and mean traces with their intervals."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist, fmean, stdev
from typing import NamedTuple

from experiments.error_bars import within_participant_errors

# Pure functions behind the results page: marginal means with within-participant error bars.


@dataclass(frozen=True)
class MarginMean:
    """Mean of one combination of levels over participants.

    Attributes
    ----------
    se_within, low, high : float or None
        Cousineau-Morey's standard error and the limits of the 95% t interval; None for one participant.
    people : list of float
        Means of single participants, at most `MAX_PEOPLE`, in the order of their size.
    """

    levels: dict[str, str]
    mean: float
    se_within: float | None
    low: float | None
    high: float | None
    participants: int
    people: list[float]


MAX_PEOPLE = 200
"""More points behind a mean would cover each other."""


CellMeans = Mapping[str, Mapping[tuple[str, ...], float]]
"""Participant -> (levels in factor order) -> mean rating."""


class RatersOfSameCells(NamedTuple):
    """Participants who rated the same cells: their means by cell, one row per participant."""

    cells: tuple[tuple[str, ...], ...]
    rows: list[tuple[float, ...]]


def raters_of_same_cells(cell_means: CellMeans) -> list[RatersOfSameCells]:
    """Participants by the cells they rated. Thousands are then computed column by column."""
    groups: dict[tuple[tuple[str, ...], ...], RatersOfSameCells] = {}
    for means in cell_means.values():
        cells = tuple(means)
        if cells not in groups:
            groups[cells] = RatersOfSameCells(cells, [])
        groups[cells].rows.append(tuple(means.values()))
    return list(groups.values())


def margin(
    people: Sequence[RatersOfSameCells],
    factors: Sequence[str],
    keep: Sequence[str],
    between: Sequence[str] = (),
) -> list[MarginMean]:
    """Marginal means of the factors in `keep`, over the participants who have every one of those levels.

    Cells of a participant are averaged without weights. Error bars: `within_participant_errors`, computed
    per group if `keep` has factors of `between`, of which a participant has one level or some.
    """
    fixed = [factors.index(name) for name in keep if name in between]
    groups: dict[tuple[str, ...], list[RatersOfSameCells]] = {}
    for those in people:
        for group, cells in _cells_by_group(those, fixed).items():
            groups.setdefault(group, []).append(_of_cells(those, cells))
    places = [factors.index(name) for name in keep]
    return [mean for group in groups.values() for mean in _of_group(group, keep, places)]


def _cells_by_group(those: RatersOfSameCells, fixed: Sequence[int]) -> dict[tuple[str, ...], list[int]]:
    """Which of their cells lie in each group, by its levels of the factors at `fixed`."""
    groups: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for number, levels in enumerate(those.cells):
        groups[tuple(levels[index] for index in fixed)].append(number)
    return groups


def _of_cells(those: RatersOfSameCells, cells: Sequence[int]) -> RatersOfSameCells:
    """The same participants with some of their cells."""
    if len(cells) == len(those.cells):
        return those
    rows = [tuple(row[number] for number in cells) for row in those.rows]
    return RatersOfSameCells(tuple(those.cells[number] for number in cells), rows)


def _of_group(
    people: Sequence[RatersOfSameCells], keep: Sequence[str], places: Sequence[int]
) -> list[MarginMean]:
    collapsed = [_collapse(those, places) for those in people]
    conditions = list(dict.fromkeys(key for columns in collapsed for key in columns))
    complete = [columns for columns in collapsed if len(columns) == len(conditions)]
    rows = [row for columns in complete for row in zip(*(columns[key] for key in conditions), strict=True)]
    if not rows:
        return []
    errors: Sequence[float | None] = within_participant_errors(rows) or [None] * len(conditions)
    return [
        _margin_mean(dict(zip(keep, key, strict=True)), column, error)
        for key, column, error in zip(conditions, zip(*rows, strict=True), errors, strict=True)
    ]


def _margin_mean(levels: dict[str, str], column: Sequence[float], error: float | None) -> MarginMean:
    mean = math.fsum(column) / len(column)
    half = None if error is None else student_t(len(column) - 1) * error
    # In the order of their size, values of several conditions cannot be put together to one person.
    values = sorted(column)
    every = max(1.0, len(values) / MAX_PEOPLE)
    shown = min(MAX_PEOPLE, len(values))
    return MarginMean(
        levels=levels,
        mean=mean,
        se_within=error,
        low=None if half is None else mean - half,
        high=None if half is None else mean + half,
        participants=len(column),
        people=[round(values[int((number + 0.5) * every)], 4) for number in range(shown)],
    )


def _collapse(those: RatersOfSameCells, places: Sequence[int]) -> dict[tuple[str, ...], Sequence[float]]:
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


# Pure functions behind the results of continuous ratings: mean traces over people, with their intervals.

MAX_POINTS = 300
"""Points of a trace that a figure on a page can show."""
COVERAGE = 0.95


@dataclass(frozen=True)
class Trace:
    """One person's play of one clip: values `step_s` apart from the clip's first frame."""

    run: int
    cell: str
    step_s: float
    values: Sequence[float]


@dataclass(frozen=True)
class CellTrace:
    """Mean of a cell over people, each person's plays averaged before; intervals are None of one person.

    Attributes
    ----------
    times_s, mean, low, high : list of float
        One value per point; at most `MAX_POINTS`, evenly spaced.
    level : float
        Mean over the whole trace.
    left_out : int
        Traces of another sampling rate than the cell's first.
    """

    cell: str
    people: int
    traces: int
    left_out: int
    times_s: list[float]
    mean: list[float]
    low: list[float] | None
    high: list[float] | None
    level: float


def cell_trace(traces: Sequence[Trace]) -> CellTrace:
    """The mean trace of one cell, as long as the shortest of its traces; at least one is needed."""
    first = traces[0]
    alike = [one for one in traces if math.isclose(one.step_s, first.step_s, rel_tol=1e-6)]
    samples = min(len(one.values) for one in alike)
    every = range(0, samples, -(-samples // MAX_POINTS))
    of_run: dict[int, list[Trace]] = {}
    for one in alike:
        of_run.setdefault(one.run, []).append(one)
    people = [[fmean(one.values[step] for one in mine) for step in every] for mine in of_run.values()]
    columns = list(zip(*people, strict=True))
    mean = [fmean(column) for column in columns]
    half = [half_width(column) for column in columns] if len(people) > 1 else None
    return CellTrace(
        cell=first.cell,
        people=len(people),
        traces=len(alike),
        left_out=len(traces) - len(alike),
        times_s=[round(step * first.step_s, 4) for step in every],
        mean=_rounded_values(mean),
        low=None if half is None else _rounded_values(m - h for m, h in zip(mean, half, strict=True)),
        high=None if half is None else _rounded_values(m + h for m, h in zip(mean, half, strict=True)),
        level=fmean(mean),
    )


def half_width(values: Sequence[float]) -> float:
    """Half the 95% t interval of a mean."""
    return student_t(len(values) - 1) * stdev(values) / math.sqrt(len(values))


def _rounded_values(values: Iterable[float]) -> list[float]:
    return [round(value, 4) for value in values]


@lru_cache(maxsize=1024)
def student_t(df: int) -> float:
    """The number t with P(-t < T < t) = 0.95 for Student's t with `df` degrees of freedom, to 1e-4.

    With theta = atan(t / sqrt(df)), P is a finite sum for whole `df` (Abramowitz & Stegun 1964, 26.7.3 and
    26.7.4), solved by bisection; beyond 200 by z + (z^3 + z) / (4 df) (26.7.5).
    """
    if df > 200:
        z = NormalDist().inv_cdf((1.0 + COVERAGE) / 2.0)
        return z + (z**3 + z) / (4.0 * df)
    low, high = 0.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if _probability_within(middle, df) < COVERAGE else (low, middle)
    return high


def _probability_within(t: float, df: int) -> float:
    theta = math.atan(t / math.sqrt(df))
    sine, cosine = math.sin(theta), math.cos(theta)
    odd = df % 2
    term, total = (cosine if odd else 1.0), 0.0
    # Terms of the sum: cos^k, k from 1 (odd df) or 0, each with its product of k / (k + 1).
    for power in range(odd, df - 1, 2):
        total += term
        term *= cosine**2 * (power + 1.0) / (power + 2.0)
    return 2.0 / math.pi * (theta + sine * total) if odd else sine * total
