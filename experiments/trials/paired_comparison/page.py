"""What of a paired comparison the participant's page is told."""

from typing import TYPE_CHECKING, Literal

from experiments.base import Declaration, Translated
from experiments.trials.paired_comparison.declaration import Presentation, paired_comparison_of

if TYPE_CHECKING:
    from experiments.definition import Experiment


class ShownReference(Declaration):
    """The label of the reference clip, and how long the canvas stays plain after it; not which clip it is."""

    label: Translated
    gap_ms: int


class ShownPairedComparison(Declaration):
    """The declared paired comparison as the page gets it: nothing of which pairs there are."""

    kind: Literal["paired_comparison"]
    question: Translated
    presentation: Presentation
    tie: Translated | None
    reference: ShownReference | None
    pointer_delay_ms: int
    expected_seconds: float


def shown(experiment: "Experiment") -> ShownPairedComparison:
    """Return the part of the declared trial that its page needs."""
    trial = paired_comparison_of(experiment)
    reference = trial.reference
    return ShownPairedComparison(
        kind=trial.kind,
        question=trial.question,
        presentation=trial.presentation,
        tie=trial.ties and trial.ties.label,
        reference=reference and ShownReference(label=reference.label, gap_ms=reference.gap_ms),
        pointer_delay_ms=trial.pointer_delay_ms,
        expected_seconds=trial.expected_seconds,
    )
