"""Whether printed means of margins and cells can hold at once in a balanced design."""

from collections.abc import Iterator, Sequence
from decimal import Decimal
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from analysis.paper.printed import PrintedMean, PrintedStudy, Rounded

Floats = NDArray[np.float64]
_SLACK = 1e-9
"""Room, in rating points, below which only the excluded upper ends of rounding intervals would fit."""


def joint_findings(
    study: PrintedStudy,
) -> Iterator[tuple[Literal["impossible"], str, str]]:
    """(kind, about, why) for sets of printed means that no complete balanced data can have."""
    if not study.balanced or len(study.mean) < 2 or possible(study, study.mean):
        return
    clash = _smallest_clash(study)
    about = ", ".join(f"{mean.name} {mean.mean}" for mean in clash)
    yield "impossible", about, f"{_in_words(study, clash)}{_repairs(study, clash)}, or trials are missing"


def possible(study: PrintedStudy, means: Sequence[PrintedMean]) -> bool:
    """Whether cell means exist whose margins round to every printed mean (upper ends excluded).

    A linear programme over the cell means: the room t left above every lower and below every upper end
    is maximised; the figures are possible where t is positive.
    """
    cells = list(product(*study.factors.values()))
    weights = np.array([_weights(study, mean, cells) for mean in means])
    rounded = [Rounded.of(mean.mean) for mean in means]
    low, high = np.array([float(r.low) for r in rounded]), np.array([float(r.high) for r in rounded])
    room = np.ones((len(means), 1))
    upper = np.hstack([weights, room])
    lower = np.hstack([-weights, np.zeros_like(room)])
    bounds = [study.scale or (None, None)] * len(cells) + [(None, 1.0)]
    solved = linprog(
        np.r_[np.zeros(len(cells)), -1.0],
        A_ub=np.vstack([upper, lower]),
        b_ub=np.r_[high, -low],
        bounds=bounds,
        method="highs",
    )
    return solved.x is not None and bool(solved.x[-1] > _SLACK)


def _weights(study: PrintedStudy, mean: PrintedMean, cells: list[tuple[str, ...]]) -> Floats:
    """Weights of the cells in a mean: the cells it covers, equally."""
    names = list(study.factors)
    inside = np.array(
        [all(cell[names.index(factor)] == level for factor, level in mean.at.items()) for cell in cells]
    )
    return np.asarray(inside / inside.sum(), dtype=np.float64)


def _smallest_clash(study: PrintedStudy) -> list[PrintedMean]:
    """Leave out means one by one as long as the rest still clashes: what is left all takes part."""
    clash = list(study.mean)
    for mean in list(study.mean):
        rest = [other for other in clash if other is not mean]
        if len(rest) > 1 and not possible(study, rest):
            clash = rest
    return clash


def _in_words(study: PrintedStudy, clash: list[PrintedMean]) -> str:
    """The clash as sums where it is between the levels of factors, else in general terms."""
    sums = []
    for factor, levels in study.factors.items():
        parts = [m for level in levels for m in clash if m.at == {factor: level}]
        if len(parts) == len(levels):
            low = sum((Rounded.of(m.mean).low for m in parts), Decimal(0))
            high = sum((Rounded.of(m.mean).high for m in parts), Decimal(0))
            names = " + ".join(m.name for m in parts)
            sums.append((len(parts), f"{low} <= {names} < {high}"))
    if len(sums) * 2 < len(clash) or len(sums) < 2:
        return "these means cannot all hold in complete, balanced data"
    same = len({count for count, _ in sums}) == 1
    rule = (
        f"both equal {sums[0][0]} times the grand mean" if same else "each is its levels times the grand mean"
    )
    return f"{' but '.join(text for _, text in sums)}, and {rule} in complete, balanced data"


def _repairs(study: PrintedStudy, clash: list[PrintedMean]) -> str:
    """Which single figure, one unit off in its last digit, would make everything possible."""
    healed = []
    for mean in clash:
        unit = Rounded.of(mean.mean).unit
        for step in (-unit, unit):
            changed = mean.model_copy(update={"mean": str(Decimal(mean.mean) + step)})
            others = [changed if other is mean else other for other in study.mean]
            if possible(study, others):
                healed.append(f"{changed.name} {changed.mean}")
    return f". One figure is off by one in its last digit ({' or '.join(healed)} would fit)" if healed else ""
