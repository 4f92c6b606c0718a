"""What a participant answers to one clip: a number on each scale, or that the scale does not apply."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictFloat, StrictInt, field_validator, model_validator

from experiments.base import Declaration, Name
from experiments.trials.clip_rating.declaration import MAX_SCALES
from experiments.trials.clip_rating.scales import SCALE_NAME
from experiments.trials.declared import Answer


class ScaleAnswer(Declaration):
    """The answer on one scale; neither a number nor `not_applicable` where the clip could not be shown."""

    response: StrictInt | Annotated[StrictFloat, Field(allow_inf_nan=False)] | None
    not_applicable: bool = False
    rt: Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)] | None = None
    """From the clip's last frame to this answer, in ms; where there is one scale it is that of the trial."""

    @field_validator("response")
    @classmethod
    def _plain(cls, value: float | None) -> float | None:
        """A whole number is stored as one, however it was sent."""
        return int(value) if isinstance(value, float) and value.is_integer() else value

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if self.not_applicable and self.response is not None:
            raise ValueError(f"expected a number or not_applicable, got both: {self.response}")
        return self

    @property
    def given(self) -> bool:
        """True where something was answered."""
        return self.not_applicable or self.response is not None


class RatingAnswer(Answer):
    """The answers to one clip by the name of their scale; a [trial.scale] is called `rating`."""

    kind: Literal["clip_rating"]
    answers: Annotated[dict[Name, ScaleAnswer], Field(min_length=1, max_length=MAX_SCALES)]
    reference_gap_ms: Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)] | None = None
    """From the reference's last frame to the rated clip's first as they were drawn, where there is one."""

    @property
    def given(self) -> bool:
        """True where every scale was answered."""
        return all(answer.given for answer in self.answers.values())

    def stored(self) -> dict[str, Any]:
        """One number for the one scale of a [trial.scale]; else an object a scale."""
        gap = {} if self.reference_gap_ms is None else {"reference_gap_ms": self.reference_gap_ms}
        if self.answers.keys() == {SCALE_NAME}:
            return self.answers[SCALE_NAME].model_dump(exclude_defaults=True, exclude={"rt"}) | gap
        answers = {name: one.model_dump(exclude_defaults=True) for name, one in self.answers.items()}
        return {"answers": answers, **gap}


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer to an attention check, which is asked on one scale."""
    answers = list(payload.get("answers", {"": payload}).values())
    return answers[0]["response"] if len(answers) == 1 else None
