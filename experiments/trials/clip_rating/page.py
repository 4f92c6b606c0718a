"""What of a single-clip rating the participant's page is told.

A model of its own, so that a key added to the declaration reaches participants only when it is put here too.
"""

from typing import TYPE_CHECKING, Literal

from experiments.base import Declaration, Translated
from experiments.trials.clip_rating.declaration import clip_rating_of
from experiments.trials.clip_rating.scales import AnyScale, Points

if TYPE_CHECKING:
    from experiments.definition import Experiment


class ShownRatingReference(Declaration):
    """The label of the reference, and how long the canvas stays plain after it; not which clip it is."""

    label: Translated
    gap_ms: int


class ShownClipRating(Declaration):
    """The declared single-clip rating as the page gets it."""

    kind: Literal["clip_rating"]
    scales: tuple[AnyScale, ...]
    arrangement: Literal["one_screen", "one_after_the_other"]
    check_scale: Points
    views: int
    reference: ShownRatingReference | None = None
    start: Literal["key", "fixation"]
    fixation_ms: int
    pointer_delay_ms: int
    confirm: bool
    comment: bool
    expected_seconds: float


def shown(experiment: "Experiment") -> ShownClipRating:
    """Return the part of the declared trial that its page needs."""
    trial = clip_rating_of(experiment)
    reference = trial.reference
    return ShownClipRating(
        kind=trial.kind,
        scales=trial.asked_scales,
        arrangement=trial.arrangement,
        check_scale=trial.check_scale,
        views=trial.views,
        reference=reference and ShownRatingReference(label=reference.label, gap_ms=reference.gap_ms),
        start=trial.start,
        fixation_ms=trial.fixation_ms,
        pointer_delay_ms=trial.pointer_delay_ms,
        confirm=trial.confirm,
        comment=trial.comment,
        expected_seconds=trial.expected_seconds,
    )
