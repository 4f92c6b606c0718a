"""What of a single-clip rating the participant's page is told.

A model of its own, so that a key added to the declaration reaches participants only when it is put here too.
"""

from typing import TYPE_CHECKING, Literal

from experiments.base import Declaration
from experiments.trials.clip_rating.declaration import Scale, clip_rating_of

if TYPE_CHECKING:
    from experiments.definition import Experiment


class ShownClipRating(Declaration):
    """The declared single-clip rating as the page gets it."""

    kind: Literal["clip_rating"]
    scale: Scale
    views: int
    start: Literal["key", "fixation"]
    fixation_ms: int
    pointer_delay_ms: int
    confirm: bool
    comment: bool
    expected_seconds: float


def shown(experiment: "Experiment") -> ShownClipRating:
    """Return the part of the declared trial that its page needs."""
    trial = clip_rating_of(experiment)
    return ShownClipRating(
        kind=trial.kind,
        scale=trial.scale,
        views=trial.views,
        start=trial.start,
        fixation_ms=trial.fixation_ms,
        pointer_delay_ms=trial.pointer_delay_ms,
        confirm=trial.confirm,
        comment=trial.comment,
        expected_seconds=trial.expected_seconds,
    )
