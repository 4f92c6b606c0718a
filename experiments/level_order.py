"""The order of levels that were read from file names: numbers by size, words of known scales by place."""

import math
import re
from collections.abc import Sequence

SCALES = tuple(
    {word: rank for rank, word in enumerate(words.split())}
    for words in (
        "verylow lowest lower low mid medium middle moderate normal average high higher highest veryhigh",
        "veryslow slowest slower slow medium middle moderate normal average quick fast quicker faster "
        "quickest fastest veryfast",
        "tiny verysmall smallest smaller small medium middle normal average big large bigger "
        "larger biggest largest huge verylarge",
        "xs s m l xl xxl",
        "min medium mid max",
        "minimum medium middle maximum",
        "subtle slight weak mild light medium moderate strong severe extreme",
        "veryshort shortest shorter short medium middle normal average long longer longest verylong",
        "few some several many most all",
        "little some half much full",
        "partial half full complete",
        "never rarely seldom sometimes occasionally often usually always",
        "terrible bad poor fair okay good excellent perfect",
        "freezing cold cool lukewarm warm hot",
        "silent quiet soft medium normal loud",
        "dark dim medium normal bright",
        "baby child adolescent teen young adult middleaged old elderly",
        "before during after",
        "pre mid post",
        "first second third fourth fifth sixth last",
        "control treatment",
        "left center centre middle right",
        "no yes",
        "off on",
        "false true",
        "without with",
        "absent present",
    )
)
"""Words of usual scales in their order."""
LEAST = {"none", "zero", "nothing", "baseline"}
"""Words that begin every scale."""
_NUMBERED = re.compile(r"((?:[^\d+-]\D*)?)([+-]?\d+(?:\.\d+)?)(\D*)")


def in_order(levels: Sequence[str]) -> list[str]:
    """The different levels in the order of tables and contrasts.

    Parameters
    ----------
    levels : sequence of str
        As files or the rows of a table have them, repeated.

    Returns
    -------
    list of str
        By size where all are numbers, or one number between the same words (`2ms`, `10ms`); by their place
        where all are words of one scale (`slow`, `medium`, `fast`); else as they came.
    """
    different = list(dict.fromkeys(levels))
    for places in (_numbers(different), _places(different)):
        if places is not None:
            return [
                level for _, level in sorted(zip(places, different, strict=True), key=lambda pair: pair[0])
            ]
    return different


def _numbers(levels: Sequence[str]) -> list[float] | None:
    """The number of each level; None unless every one has one and the same words around it."""
    try:
        numbers = [float(level) for level in levels]
    except ValueError:
        fits = [fit for level in levels if (fit := _NUMBERED.fullmatch(level)) is not None]
        alike = len(fits) == len(levels) and len({(fit[1], fit[3]) for fit in fits}) == 1
        return [float(fit[2]) for fit in fits] if alike else None
    return numbers if all(map(math.isfinite, numbers)) else None


def _places(levels: Sequence[str]) -> list[int] | None:
    """The place of each level in the first scale that has them all; None without one."""
    words = [re.sub(r"[\W_]", "", level.casefold()) for level in levels]
    for scale in SCALES:
        if all(word in scale or word in LEAST for word in words) and any(word in scale for word in words):
            return [scale.get(word, -1) for word in words]
    return None
