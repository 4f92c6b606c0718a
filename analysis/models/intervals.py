"""Profile likelihood intervals beside the estimates of a linear mixed model."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.models.mixed_result import MixedResult
from analysis.models.profile import Profile
from analysis.models.reml import CrossProducts
from analysis.models.units import Units

Floats = NDArray[np.float64]


def with_intervals(
    result: MixedResult,
    c: CrossProducts,
    theta: Floats,
    units: Units,
    progress: Callable[[str], None] | None = None,
    scales: Sequence[float] = (),
) -> MixedResult:
    """Add profile intervals; standard deviations of correlated slopes are no parameters and have none.

    Parameters
    ----------
    result : MixedResult
        Without intervals.
    c : CrossProducts
        What it was fitted to.
    theta : (m,) array
        The REML estimate.
    units : Units
        The scale of `c`.
    progress : callable, optional
        Takes a word on every interval before it is computed.
    scales : sequence of float
        Standard deviations of the covariates whose slopes the components are; 1 of others. Empty for all 1.
    """
    profile = Profile(c, theta)
    own = [row for row in result.components if row.group == result.components[0].group]
    positions: list[int | None] = list(range(len(own)))
    if result.slopes == "correlated":
        positions = [None] * len(own)
    positions = [None if row.correlations else k for row, k in zip(own, positions, strict=True)]
    further = len(result.components) - 1 - len(own)
    positions += [c.blocks[0].theta.stop + k for k in range(further)]
    known_sds = sum(k is not None for k in positions) + 1
    count = known_sds + len(result.coefficients)

    def say(number: int, name: str) -> None:
        if progress:
            progress(f"interval {number} of {count}, {name}")

    ends: list[tuple[float, float] | None] = []
    number = 0
    for row, k, scale in zip(result.components, positions, scales or [1.0] * len(positions), strict=False):
        if k is None:
            ends.append(None)
            continue
        number += 1
        say(number, f"SD of {row.group} {row.term}".strip())
        low, high = profile.sd(k)
        ends.append((low / scale, high / scale))
    ends.append(profile.sigma())
    coefficients = []
    for column, known in enumerate(result.coefficients):
        say(count - len(result.coefficients) + column + 1, known.name)
        ci = units.interval(profile.coefficient(column), intercept=column == 0)
        coefficients.append(replace(known, ci=ci))
    components = tuple(
        replace(row, ci=ci and units.interval(ci)) for row, ci in zip(result.components, ends, strict=True)
    )
    return _said(replace(result, coefficients=tuple(coefficients), components=components))


def _said(result: MixedResult) -> MixedResult:
    """With a note on every interval that has no end."""
    named = [(row.name, row.ci) for row in result.coefficients]
    named += [(f"{row.group} {row.term}".strip(), row.ci) for row in result.components]
    open_ended = [name for name, ci in named if ci and not np.isfinite(ci).all()]
    if not open_ended:
        return result
    note = f"the likelihood bounds no profile interval of {', '.join(open_ended)} on at least one side"
    return replace(result, notes=(*result.notes, note))
