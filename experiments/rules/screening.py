"""Rules of [[screening]], which end a run early: forms, attention checks, the device."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from experiments.declaration.base import Declaration, Name, Translated
from experiments.declaration.forms import Form, Question
from experiments.errors import did_you_mean

# Attention checks: questions with a prescribed answer between the trials.


class AttentionChecks(Declaration):
    """Questions with a prescribed answer between trials, such as "please answer 2 this time"."""

    per_block: Annotated[int, Field(ge=0, le=10)] = 0
    """Checks in each block, at random positions but never first. They are stored with kind `attention`."""
    text: Translated = Field(
        default_factory=lambda: {
            "en": "Attention check: please answer **{response}** on this screen.",
            "de": "Aufmerksamkeitsprüfung: Bitte antworten Sie hier mit **{response}**.",
        }
    )
    """Text of the check in Markdown. `{response}` is replaced by the required answer."""


# Screening by failed attention checks.


def failed_checks(allowed: int) -> str:
    """The reason of a rule that allows this number of failed attention checks."""
    return f"{allowed + 1} or more failed attention checks" if allowed else "a failed attention check"


NO_BRACES = str.maketrans("{}", "()")
"""Sentences of a Methods section have their numbers in braces."""


class ScreenAttention(Declaration):
    """Screen out participants who failed more than `more_than` attention checks."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    """The name of this rule."""
    more_than: Annotated[int, Field(ge=0)] = 0
    """Number of failed checks that is still allowed; 0 ends the run at the first failure."""

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return failed_checks(self.more_than)


# Screening by the device.


class ScreenDevice(Declaration):
    """Screen out participants whose browser, screen or window cannot show the clips as [display] requires.

    Without this rule, the page explains what is missing, and the link stays valid for another device.
    """

    rule: Literal["device"] = "device"
    """The name of this rule."""

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return "a browser, screen or window that cannot show the clips"


# Screening by an answer of a form.


# Decision 0220: Screening rules end a run and give no code unless one is declared.
class ScreenFormAnswer(Declaration):
    """Screen out by an answer: one of `refused`, or a number under `below` or over `above`.

    The run ends as soon as the form is sent. Unanswered questions screen nobody out, so set `required =
    true`.
    """

    rule: Literal["form_answer"] = "form_answer"
    """The name of this rule."""
    form: Name
    """Name of the form."""
    field: Name
    """Name of the question in the form."""
    refused: tuple[str, ...] = ()
    """Option values that end the run; for questions with options."""
    below: int | None = None
    """Numbers smaller than this end the run; for numbers and ratings."""
    above: int | None = None
    """Numbers larger than this end the run; for numbers and ratings."""

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        low = [] if self.below is None else [f"below {self.below}"]
        high = [] if self.above is None else [f"above {self.above}"]
        answers = " or ".join([*self.refused, *low, *high]).translate(NO_BRACES)
        return f"the answer {answers} to '{self.field}' of the form '{self.form}'"

    def screens_out(self, answer: object) -> bool:
        """True if this answer (text, number, or list of texts) ends the run."""
        if isinstance(answer, int):
            low = self.below is not None and answer < self.below
            return low or (self.above is not None and answer > self.above)
        given = answer if isinstance(answer, list) else [answer]
        return any(value in self.refused for value in given)

    def fault(self, forms: Sequence[Form]) -> str | None:
        """What is wrong with this rule, given the declared forms; None if nothing is."""
        form = next((form for form in forms if form.name == self.form), None)
        if form is None:
            return f"no form is called '{self.form}'{did_you_mean(self.form, [form.name for form in forms])}"
        field = next((field for field in form.fields if field.name == self.field), None)
        if field is None:
            near = did_you_mean(self.field, [field.name for field in form.fields])
            return f"form '{form.name}' has no field '{self.field}'{near}"
        return self._fault_of(field)

    def _fault_of(self, field: Question) -> str | None:
        limits = self.below is not None or self.above is not None
        if field.screened_by == "limits":
            fits = limits and not self.refused
            return None if fits else f"'{field.name}' is a number: use `below` or `above`, not `refused`"
        if field.screened_by is None:
            return f"'{field.name}' is free text; only choices and numbers can be screened"
        if limits or not self.refused:
            return f"'{field.name}' is a choice: use `refused`, not `below` or `above`"
        wrong = next((value for value in self.refused if value not in field.values), None)
        return f"'{field.name}' has no option '{wrong}'{did_you_mean(wrong, field.values)}" if wrong else None
