"""What the name of a column says: which eye it is of, and whether high is shut."""

import re
from collections.abc import Sequence
from itertools import pairwise, zip_longest

from stimuli_builder.blinks.profile import Eye

_WORD = re.compile(r"[A-Z]{2,}(?=left|right|$|[^A-Za-z])|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
"""A word of a column's name: EAR_l, leftEAR, EARleft, l_ear, EyeBlinkLeft."""
_ACTION_UNIT = re.compile(r"AU[0-9]+_[rc](?![a-z])", re.IGNORECASE)
"""OpenFace's: r is a regression's intensity, not the right eye."""
_SIDES: dict[str, Eye] = {
    "l": "left", "left": "left", "lefteye": "left", "leye": "left",
    "r": "right", "right": "right", "righteye": "right", "reye": "right",
}  # fmt: skip
_SIDED = re.compile(
    r"(?P<first>left|right)(eye|ear|gap|blink|lid|distance)|(eye|ear|gap|blink|lid|eyeblink)(?P<last>left|right)"
)
"""Words written together: lefteye, eyeblinkleft; not leftover, rightmost."""
_NO_SIDE_BEFORE = re.compile(r"[0-9]+|squared")
"""What a single letter before it is no side of: L2, r_squared."""
_CLOSURES = frozenset({"closure", "closedness", "au45"})
_SHUT = frozenset({"blink", "closed"})
"""Words of columns that are high where the lids are shut: ARKit's eyeBlinkLeft, OpenFace's AU45_r."""
_OPENINGS = frozenset(
    {"distance", "ear", "gap", "opening", "aperture", "openness", "fissure", "height", "px", "mm"}
)
"""Words of a distance, by which blink and closed say only what it was measured for: blink_ear, closed_px."""


_LIDS = frozenset({"ear", "aperture", "openness", "fissure", "closure", "closedness", "au45", "eyeblink"})
"""Words of lids alone, by which a tracker's two columns are known among those of pupils and gaze."""


def words_of(column: str) -> list[str]:
    """The words of a column's name in small letters: left and ear for leftEAR."""
    return [word.lower() for word in _WORD.findall(column)]


def eye_of(column: str) -> Eye | None:
    """Tell the eye from the words of a column's name: l, left, r, right; else None."""
    if _ACTION_UNIT.match(column):
        return None
    words = words_of(column)
    sides = {
        side
        for word, following in zip_longest(words, words[1:], fillvalue="")
        if (side := _side(word)) and not (len(word) == 1 and _NO_SIDE_BEFORE.fullmatch(following))
    }
    return sides.pop() if len(sides) == 1 else None


def eye_pair(columns: Sequence[str]) -> tuple[int, int] | None:
    """Numbers of the left and the right eye's columns; None where not one is of each."""
    return left_and_right([eye_of(column) for column in columns])


def left_and_right(eyes: Sequence[Eye | None]) -> tuple[int, int] | None:
    """Numbers of the one left and the one right eye; None where there are none, or more."""
    if eyes.count("left") != 1 or eyes.count("right") != 1:
        return None
    return eyes.index("left"), eyes.index("right")


def _side(word: str) -> Eye | None:
    """The eye of one word in small letters."""
    sided = _SIDED.fullmatch(word)
    return _SIDES.get(word if sided is None else sided["first"] or sided["last"])


def is_of_lids(column: str) -> bool:
    """Whether a column's name says that it is the opening or closure of an eye, not a pupil or a gaze."""
    words = words_of(column)
    return not _LIDS.isdisjoint({*words, *("".join(pair) for pair in pairwise(words))})


def is_high_when_shut(column: str) -> bool:
    """Whether a column's name is one of a closure, not of an opening."""
    words = words_of(column)
    pairs = {"".join(pair) for pair in pairwise(words)}
    known = pairs.union(words)
    return not _CLOSURES.isdisjoint(known) or (not _SHUT.isdisjoint(known) and _OPENINGS.isdisjoint(known))
