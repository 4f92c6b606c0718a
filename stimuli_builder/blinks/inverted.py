"""Series that are high where the lids are shut, turned round: closures, blendshapes, action units."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.errors import InputError
from stimuli_builder.blinks.column_names import is_high_when_shut
from stimuli_builder.blinks.profile import Array

REST = 0.25
"""A series that rests below this part of its top, and is above half of it for no longer than this part of the
time, is one of a closure, or of eyes that are shut nearly always: a person says which."""
TOP_PERCENTILE = 99.5
RESTS_HIGH = 0.6
"""A series that is named as a closure and rests above this part of its top is none, or of shut eyes."""
GLITCH, GLITCHES = 2.0, 3
"""A greatest value that is so many times the third greatest is a glitch, and no level of a shut lid."""
_WAYS = "add --inverted if high is shut, --not-inverted if it is an opening"


def opening_of(
    values: Array, column: str, path: Path, inverted: bool | None, same_kind: Sequence[Array]
) -> tuple[Array, str]:
    """Return a column as an opening, 0 where the lids meet, and a line if it was turned round for that.

    Closures up to 1 become 1 - closure; others are taken from their greatest value that is no glitch.

    Parameters
    ----------
    inverted : bool or None
        Whether high is shut; None tells it from the column's name.
    same_kind : sequence of float64 array
        The column and those of its kind, as the other eye's: one greatest value holds for all, so that an eye
        that closes less keeps to be seen as such.

    Raises
    ------
    InputError
        Nobody says, and the series looks otherwise than its name.
    """
    by_name, known = is_high_when_shut(column), values[np.isfinite(values)]
    if inverted is None and not by_name and _rests_at_the_bottom(known):
        raise InputError(
            f"{path.name}: column '{column}' rests at {np.median(known):.3g} and rises to "
            f"{known.max():.3g} for short times, as a closure does (1 = shut): {_WAYS}"
        )
    if inverted is None and by_name and _rests_high(known):
        raise InputError(
            f"{path.name}: column '{column}' is named as a closure (1 = shut) and rests at "
            f"{np.median(known):.3g}, near its top, as an opening does: {_WAYS}"
        )
    if not (by_name if inverted is None else inverted) or not known.size:
        return values, ""
    top = max(1.0, *(_top(one[np.isfinite(one)]) for one in same_kind))
    why = "as its name says" if inverted is None else "as --inverted says"
    return (
        np.maximum(top - values, 0.0),
        f"{path.name}: '{column}' is high where lids are shut, {why}: taken as {top:g} minus it",
    )


def _top(known: Array) -> float:
    """The greatest value; the third greatest where that is a glitch; 0 of none."""
    if not known.size:
        return 0.0
    count = min(GLITCHES, known.size)
    highest = np.sort(np.partition(known, -count)[-count:])
    return float(highest[0] if highest[-1] > GLITCH * max(highest[0], 0.5) else highest[-1])


def _rests_high(known: Array) -> bool:
    return bool(known.size and np.median(known) > RESTS_HIGH * np.percentile(known, TOP_PERCENTILE) > 0)


def _rests_at_the_bottom(known: Array) -> bool:
    if not known.size:
        return False
    middle, top = np.percentile(known, [50, TOP_PERCENTILE])
    return bool(0 <= middle < REST * top and (known > top / 2).mean() <= REST)
