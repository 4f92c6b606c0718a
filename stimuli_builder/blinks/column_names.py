"""What the name of a column says: which eye it is of, and whether high is shut."""

import re
from itertools import pairwise

from stimuli_builder.blinks.profile import Eye

_WORD = re.compile(r"[A-Z]{2,}(?=left|right|$|[^A-Za-z])|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
"""A word of a column's name: EAR_l, leftEAR, EARleft, l_ear, EyeBlinkLeft."""
_ACTION_UNIT = re.compile(r"AU[0-9]+_[rc]", re.IGNORECASE)
"""OpenFace's: r is a regression's intensity, not the right eye."""
_SIDES: dict[str, Eye] = {
    "l": "left", "left": "left", "lefteye": "left", "leye": "left",
    "r": "right", "right": "right", "righteye": "right", "reye": "right",
}  # fmt: skip
_SHUT = frozenset({"blink", "closure", "closed", "closedness", "au45"})
"""Words of columns that are high where the lids are shut: ARKit's eyeBlinkLeft, OpenFace's AU45_r."""


def eye_of(column: str) -> Eye | None:
    """Tell the eye from the words of a column's name: l, left, r, right; else None."""
    if _ACTION_UNIT.fullmatch(column):
        return None
    words = [word.lower() for word in _WORD.findall(column)]
    sides = {_SIDES[word] for word in words if word in _SIDES}
    if not sides and words and words[0].startswith(("left", "right")):
        return "left" if words[0].startswith("left") else "right"
    return sides.pop() if len(sides) == 1 else None


def is_high_when_shut(column: str) -> bool:
    """Whether a column's name is one of a closure, not of an opening."""
    words = [word.lower() for word in _WORD.findall(column)]
    pairs = {"".join(pair) for pair in pairwise(words)}
    return not _SHUT.isdisjoint(pairs.union(words))
