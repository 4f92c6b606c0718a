"""Which frames of a label file a person has changed or accepted, and which are as a program proposed them."""

from dataclasses import replace

import numpy as np

from experiments.errors import counted
from stimuli_builder.tracking.labels import Labels

DETECTED = "detector on single frames, not reviewed"
TRACKED = "proposed by the tracker for correction by hand"
SAME_PX = 0.0006
"""Points are written to 0.001 px: what nobody moved comes back nearer than this."""


def as_proposed(labels: Labels) -> frozenset[int]:
    """Frames whose points are still those proposed, and which nobody has accepted.

    The labelling page keeps accepted frames alone, and leaves no proposal standing for them.
    """
    proposed = labels.proposed or {}
    return frozenset(
        number
        for number, points in labels.frames.items()
        if number in proposed
        and proposed[number].shape == points.shape
        and np.abs(points - proposed[number]).max() < SAME_PX
    )


def by_hand(labels: Labels) -> Labels:
    """The same file with the frames alone that a person changed or accepted; there may be none."""
    waiting = as_proposed(labels)
    return replace(labels, frames={n: points for n, points in labels.frames.items() if n not in waiting})


def unreviewed(labels: Labels) -> str:
    """A line where labels given to be learnt from hold frames that nobody saw; empty where none is known."""
    waiting, count = len(as_proposed(labels)), len(labels.frames)
    if waiting:
        return (
            f"{labels.path}: {waiting} of {counted(count, 'frame')} are as they were proposed and nobody "
            "accepted them; all train as given: correct or accept each on the labelling page"
        )
    if labels.proposed is None and labels.origin in (DETECTED, TRACKED):
        return (
            f"{labels.path}: its origin is '{labels.origin}' and it keeps no proposals, so that nothing "
            "tells which frames a person saw; save it on the labelling page once they are right"
        )
    return ""


def unmarked(labels: Labels) -> str:
    """A line where a file of `--relabel` is of a version that marked no proposals; empty else."""
    if labels.proposed is not None or labels.origin != TRACKED:
        return ""
    return (
        f"{labels.path}: an earlier version wrote it and it keeps no proposals, so that all its "
        f"{counted(len(labels.frames), 'frame')} count as corrected; remove it and run again if they are not"
    )
