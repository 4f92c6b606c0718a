"""Series that are high where the lids are shut, turned round: closures, blendshapes, action units."""

from pathlib import Path

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.column_names import is_high_when_shut
from stimuli_builder.blinks.profile import Array

REST = 0.25
"""A series that rests below this part of its top, and is above half of it for no longer than this part of the
time, is one of a closure, or of eyes that are shut nearly always: a person says which."""
TOP_PERCENTILE = 99.5


def opening_of(values: Array, column: str, path: Path, inverted: bool | None) -> tuple[Array, str]:
    """Return a column as an opening, 0 where the lids meet, and a line if it was turned round for that.

    Closures up to 1 become 1 - closure; others are taken from their greatest value.

    Parameters
    ----------
    inverted : bool or None
        Whether high is shut; None tells it from the column's name.

    Raises
    ------
    InputError
        Nobody says, the name does not tell, and the series looks like one of a closure.
    """
    by_name = is_high_when_shut(column)
    if inverted is None and not by_name and _rests_at_the_bottom(values):
        raise InputError(
            f"{path.name}: column '{column}' rests near 0 and rises for short times, as a closure does "
            "(1 = shut): add --inverted if high is shut, --not-inverted if it is an opening"
        )
    if not (by_name if inverted is None else inverted) or not np.isfinite(values).any():
        return values, ""
    top = max(1.0, float(np.nanmax(values)))
    why = "as its name says" if inverted is None else "as --inverted says"
    return (
        top - values,
        f"{path.name}: '{column}' is high where lids are shut, {why}: taken as {top:g} minus it",
    )


def _rests_at_the_bottom(values: Array) -> bool:
    known = values[np.isfinite(values)]
    if not known.size:
        return False
    middle, top = np.percentile(known, [50, TOP_PERCENTILE])
    return bool(0 <= middle < REST * top and (known > top / 2).mean() <= REST)
