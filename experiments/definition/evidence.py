"""What a study asks for to tell people from programs: checks that show their content by motion alone."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.base import Declaration, Translated
from experiments.checks import CHECK_KINDS, CheckName
from experiments.definition.names import refuse_repeats


class OtherWay(Declaration):
    """What somebody does who cannot see a motion check. Who takes it is at most `unclear`."""

    label: Translated
    """The button that leads to it, offered before the clip and beside the answers."""
    text: Translated
    """Markdown of the page behind the button; its button goes on with the study."""


class CheckWording(Declaration):
    """The words of one kind of check, in place of the program's own."""

    check: CheckName
    """The kind of check."""
    question: Translated
    """What is asked after the clip."""
    choices: tuple[Translated, ...]
    """The answers in the order of the kind's own."""


class MotionChecks(Declaration):
    """Short clips between the trials in which a digit, a direction or a shape is defined by motion alone.

    Each is asked as a trial of its own, stored with kind `check` and never analysed.
    """

    per_block: Annotated[int, Field(ge=0, le=10)] = 0
    """Checks in each block, at random places but never first."""
    kinds: Annotated[tuple[CheckName, ...], Field(min_length=1, max_length=5)] = ("digit",)
    """Kinds of check: `digit`, `direction` and `shape` of random dots; `first_blink` (a full blink and a half
    one) and `first_eye` in the study's own look, which two pictures in their order give away."""
    difficulty: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.3
    """From 0 to 1: the share of dots that do not follow (half of them at 1); how alike the two blinks are,
    or how close the two eyes."""
    contrast: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)] = 0.6
    """Contrast of the dots against the page's background, from above 0 to 1."""
    seconds: Annotated[float, Field(ge=1.2, le=6, allow_inf_nan=False)] = 2.4
    """Length of a check's clip."""
    clips: Annotated[int, Field(ge=1, le=500)] = 24
    """How many check clips are made. Nobody sees one twice; the more there are, the less a list of
    their answers is worth."""
    other_way: OtherWay | None = None
    """The way around for people who cannot see such clips; without it they can only guess."""
    wording: tuple[CheckWording, ...] = ()
    """Question and answers of kinds of check, in place of the program's own, which has those of the page."""

    @model_validator(mode="after")
    def _as_many_choices(self) -> Self:
        refuse_repeats([words.check for words in self.wording], "wording")
        for words in self.wording:
            count = len(CHECK_KINDS[words.check].choices)
            if len(words.choices) != count:
                raise ValueError(f"wording: {words.check} has {count} choices, got {len(words.choices)}")
        return self


class Evidence(Declaration):
    """What is asked for to tell people from programs, beside what every page brings (docs/evidence.md)."""

    online_recruitment: bool = False
    """For participants recruited online: each run has two motion checks and one attention question at least,
    at random places of evenly spread blocks. Without checks no run is rated likely a person's. Consent must
    mention that clips flicker, and `stimuli checks` makes the clips."""
    motion_checks: MotionChecks = MotionChecks()
    """Checks that show their content by motion alone."""
