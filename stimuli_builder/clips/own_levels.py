"""What was read of the levels of somebody's own clips, and what looks like a slip in it."""

import re
from collections import Counter
from collections.abc import Iterator
from difflib import SequenceMatcher
from itertools import permutations

from experiments.own_clips import FIRST_FIELD, Placed, levels_of

ALIKE = 0.7
"""Ratio of `SequenceMatcher` from which two levels may be one, misspelt: 0.75 of slow and slwo."""
RARER = 3
"""A level is taken for a slip of another that has so many times its clips."""
MAX_NAMED = 8
_NUMBERED = re.compile(r"(.+?)([_\- .]?)(\d+)")


def understood(placed: Placed, pattern: str | None) -> list[str]:
    """Lines for people: each factor's levels with their clips, then what looks wrong."""
    return [*_levels(placed), *_slips(placed), *_numbers_in_levels(placed, pattern)]


def _counts(placed: Placed) -> dict[str, Counter[str]]:
    known = levels_of(placed)
    counts = {name: Counter(dict.fromkeys(levels, 0)) for name, levels in known.items()}
    for levels, _ in placed.values():
        for name, level in levels.items():
            counts[name][level] += 1
    return counts


def _levels(placed: Placed) -> Iterator[str]:
    for name, counts in _counts(placed).items():
        named = [f"{level} ({count})" for level, count in counts.items()][:MAX_NAMED]
        more = f" and {len(counts) - MAX_NAMED} more" if len(counts) > MAX_NAMED else ""
        yield f"levels of {name}, with their clips: {', '.join(named)}{more}"


def _slips(placed: Placed) -> Iterator[str]:
    for name, counts in _counts(placed).items():
        for rare, usual in permutations(counts, 2):
            if counts[usual] >= RARER * counts[rare] and _alike(rare, usual):
                file = next(file for file, (levels, _) in placed.items() if levels[name] == rare)
                yield f"'{rare}' of {name} ({file}) looks like '{usual}': correct the name if it is meant"


def _alike(one: str, other: str) -> bool:
    # Levels that differ in a number, as 2ms and 20ms, are levels.
    if re.findall(r"\d+", one) != re.findall(r"\d+", other):
        return False
    return SequenceMatcher(None, one.casefold(), other.casefold()).ratio() >= ALIKE


def _numbers_in_levels(placed: Placed, pattern: str | None) -> Iterator[str]:
    """Where a pattern without `{exemplar}` took the number of each clip into a level."""
    if pattern is None or f"{{{FIRST_FIELD}}}" in pattern:
        return
    for name, counts in _counts(placed).items():
        fits = [_NUMBERED.fullmatch(level) for level in counts]
        numbered = [fit for fit in fits if fit is not None]
        bases = Counter(fit[1] for fit in numbered)
        if len(numbered) == len(counts) > len(bases) and len(bases) > 1:
            meant = pattern.replace(f"{{{name}}}", f"{{{name}}}{numbered[0][2]}{{{FIRST_FIELD}}}", 1)
            end = f"levels of {name} end in numbers ({numbered[0][0]})"
            yield f"{end}; if they number the clips, give '{meant}'"
