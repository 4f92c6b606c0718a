"""What is said under the table of a report's model: its random terms and its doubts, in labels."""

import re
from typing import TYPE_CHECKING

from analysis.plans.result import Labels
from analysis.report.numbers import fixed

if TYPE_CHECKING:
    from analysis.models.mixed_result import MixedResult
    from analysis.models.ordinal_result import OrdinalResult

_MOVED = re.compile(r"(?P<names>.+)(?P<said>: one level for each participant, taken as between participants)")
_SLOPES = ("slope", "slopes")


def notes_of(result: "MixedResult | OrdinalResult", labels: Labels) -> tuple[str, ...]:
    """Standard deviations of the random terms, a grouping after another, and what was doubtful; in labels."""
    by_group: dict[str, list[str]] = {}
    for one in result.components:
        group = f"{labels.term(one.group)}:" if one.term else one.group
        by_group.setdefault(group, []).append(f"{labels.term(one.term)} {fixed(one.sd, 3)}".strip())
    said = "; ".join(f"{group} {', '.join(terms)}" for group, terms in by_group.items())
    sds = (f"Standard deviations: {said}.",) if said else ()
    return (*sds, *(_in_labels(note, result, labels) for note in result.notes))


def _in_labels(note: str, result: "MixedResult | OrdinalResult", labels: Labels) -> str:
    """A note with labels where terms stand; a factor may be called as a word of the note is, such as fit."""
    if moved := _MOVED.fullmatch(note):
        return ", ".join(map(labels.term, moved["names"].split(", "))) + moved["said"]
    said = {
        f"{one.group} {one.term}": f"{labels.term(one.group)} {labels.term(one.term)}"
        for one in result.components
        if one.term
    }
    for effect in result.effects:
        said |= {f"{word} of {effect.effect}": f"{word} of {labels.term(effect.effect)}" for word in _SLOPES}
    phrases = "|".join(sorted(map(re.escape, said), key=len, reverse=True))
    return re.sub(rf"(?<![\w:])(?:{phrases})(?!\w|:\w)", lambda one: said[one[0]], note)
