"""Declared lists of clips, dealt to participants in turn."""

from collections.abc import Sequence

from experiments.errors import did_you_mean
from experiments.trials.declared import ClipSpec


def label(clip: ClipSpec) -> str:
    """A clip as lists write it: its cell and its exemplar, joined by a slash."""
    return f"{clip.cell}/{clip.exemplar}"


def listed(clips: Sequence[ClipSpec], lists: Sequence[Sequence[str]], number: int) -> frozenset[ClipSpec]:
    """The clips of the list that falls to this place."""
    mine = set(lists[number % len(lists)])
    return frozenset(clip for clip in clips if label(clip) in mine)


def fault(clips: Sequence[ClipSpec], lists: Sequence[Sequence[str]]) -> str | None:
    """The first clip in `lists` that the design does not have; None where there is none."""
    known = [label(clip) for clip in clips]
    for number, names in enumerate(lists, start=1):
        for name in names:
            if name not in known:
                return f"list {number}: the design has no clip '{name}'{did_you_mean(name, known)}"
    return None
