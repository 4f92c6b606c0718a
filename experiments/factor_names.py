"""What a factor may be called, by the parts that file names have in its place."""

import re
from collections.abc import Sequence

from experiments.trials import reserved_names

WORDS = {
    "speed": "slow slower slowest medium middle normal fast faster fastest quick",
    "emotion": "happy sad angry anger afraid fear fearful neutral disgust surprise joy",
    "gender": "female male woman man women men girl boy nonbinary",
    "age": "young middleaged old adult child",
    "side": "left right centre center",
    "direction": "up down upward downward upwards downwards forward forwards backward backwards",
    "size": "tiny small medium large big huge",
    "height": "low mid high",
    "colour": "red green blue yellow black white grey gray orange purple brown pink",
    "agent": "human robot android avatar person agent",
    "condition": "control treatment baseline experimental",
    "system": "ours baseline proposed mocap gt groundtruth reference natural ablation previous handmade",
    "presence": "on off with without yes no present absent",
    "quality": "original compressed reference impaired",
    "profile": "real model",
}  # fmt: skip
"""Names of factors, each with words that its levels often are; the first that has all of them is taken."""
TAKES = ("exemplar", "ex", "take", "rep", "clip", "no", "nr", "n", "v", "version", "item", "trial")
"""Words that number clips of the same kind."""
_KEYED = re.compile(r"([A-Za-z][A-Za-z0-9]*)([-=])(.+)")
_NUMBERED = re.compile(r"([A-Za-z]+)()(\d+(?:[.p]\d+)?)")
_WITH_UNIT = re.compile(r"(.*\d)(ms|s|fps|hz|px|mm|cm|deg|db|percent)", re.IGNORECASE)


def name_and_frame(parts: Sequence[str]) -> tuple[str | None, str, str]:
    """What a factor may be called by its levels, and what stands before and after each of them.

    Parameters
    ----------
    parts : sequence of str
        The parts of file names in one place, such as `speed-slow` and `speed-fast`, or `slow` and `fast`.

    Returns
    -------
    str or None
        The name; None where the parts do not give one away.
    str
        What begins each part without belonging to the level, such as `speed-`.
    str
        What ends each part likewise, such as the unit of `dur60ms`.
    """
    name, head = _name_and_head(parts)
    tails = {fit[2] if (fit := _WITH_UNIT.fullmatch(part)) else "" for part in parts}
    if name is None and len(tails) == 1 and (tail := tails.pop()):
        name, head = _name_and_head([part.removesuffix(tail) for part in parts])
        if name is not None:
            return name, head, tail
    return name, head, ""


def _name_and_head(parts: Sequence[str]) -> tuple[str | None, str]:
    for form in (_KEYED, _NUMBERED):
        fits = [form.fullmatch(part) for part in parts]
        heads = {fit[1] + fit[2] for fit in fits if fit is not None}
        if None not in fits and len(heads) == 1:
            head = heads.pop()
            name = head.rstrip("-=").lower()
            return (name if _free(name) else None), head
    words = {re.sub(r"[^a-z]", "", part.lower()) for part in parts}
    guessed = (name for name, levels in WORDS.items() if words <= set(levels.split()))
    return next((name for name in guessed if _free(name)), None), ""


def _free(name: str) -> bool:
    return name not in reserved_names()
