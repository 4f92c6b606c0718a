"""The [trial] of any kind, and the answer to a motion check, which studies of every kind have."""

from typing import Annotated, Literal, Self

from pydantic import Field, StrictInt, model_validator

from experiments.declaration.clip_rating import ClipRating
from experiments.declaration.continuous_rating import ContinuousRating
from experiments.declaration.paired_comparison import PairedComparison
from experiments.declaration.threshold import Threshold
from experiments.declaration.trial import Answer, ByKind, TrialDeclaration

# The [trial] of every kind, and the type of a [trial] that is of any of them.

TRIALS: dict[str, type[TrialDeclaration]] = {
    str(trial.model_fields["kind"].default): trial
    for trial in (ClipRating, PairedComparison, Threshold, ContinuousRating)
}
"""Every kind's declaration by the name that a TOML gives it; the first is meant where none is given."""

AnyTrial = Annotated[TrialDeclaration, ByKind(lambda: TRIALS, implied=True)]


# The answer to a motion check, the same in studies of every kind of trial.

MAX_CHOICES = 9
"""A key each."""


class CheckAnswer(Answer):
    """The number of the choice; none where the clip could not be shown, or the other way was taken."""

    kind: Literal["check"]
    check: Annotated[StrictInt, Field(ge=1, le=MAX_CHOICES)] | None
    """Number of the choice, from 1."""
    other_way: bool = False
    """True where the way around was taken that the study offers."""

    @property
    def given(self) -> bool:
        """True where the check itself was answered."""
        return self.check is not None

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if self.other_way and self.check is not None:
            raise ValueError(f"expected a choice or the other way, got both: {self.check}")
        return self
