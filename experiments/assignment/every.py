"""Every clip for everybody."""

from collections.abc import Sequence

from experiments.trials.declared import ClipSpec


def every_clip(clips: Sequence[ClipSpec]) -> frozenset[ClipSpec]:
    """All of `clips`, those of the participant's group."""
    return frozenset(clips)
