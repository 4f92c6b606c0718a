"""Kind words to who answers without care, and how a run ends that goes on so."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration, Translated
from experiments.rules import WarningRule


class Warnings(Declaration):
    """Warnings while the run goes on. After a warning was shown, only answers after it count for another."""

    rules: tuple[WarningRule, ...] = ()
    """What is warned of; without rules nobody is warned."""
    maximum: Annotated[int, Field(ge=1, le=10)] = 2
    """Warnings that a participant gets."""
    then: Literal["end", "go_on"] = "end"
    """What a lapse after the last warning does: it ends the run as screened out, or nothing more happens."""
    code: Literal["failed_check", "screened_out"] = "failed_check"
    """Which of the recruiter's codes a run gets that ended so; that of screened out where there is no other.
    Never the code of a complete run."""
    end_text: Translated = Field(
        default_factory=lambda: {
            "en": "Your answers went on as we had pointed out to you, so the study ends here. What you have "
            "answered is stored.",
            "de": "Ihre Antworten blieben so, wie wir es angesprochen hatten; deshalb endet die Studie "
            "hier. Was Sie geantwortet haben, ist gespeichert.",
        }
    )
    """What stands above the last page of a run that ended so, in every language."""
