"""Rules declared before the data: playback quality, attention checks, screening, exclusions."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration, Name, Translated
from experiments.errors import did_you_mean
from experiments.forms import (
    ChoiceField,
    Form,
    FormField,
    LikertField,
    MultipleChoiceField,
    NumberField,
)

Share = Annotated[float, Field(ge=0, le=1)]


class PlaybackRules(Declaration):
    """When a play is flagged or failed. Counts are frames of the clip, times are milliseconds.

    A play breaking a `failed_*` limit is failed (its clip is offered again at the end of the block), one
    breaking a `flagged_*` limit is flagged, any other is good.
    """

    flagged_missing_frames: Annotated[int, Field(ge=0)] = 0
    failed_missing_frames: Annotated[int, Field(ge=0)] = 3
    flagged_late_frames: Annotated[int, Field(ge=0)] = 2
    flagged_longest_gap_ms: Annotated[float, Field(gt=0)] = 70.0
    failed_longest_gap_ms: Annotated[float, Field(gt=0)] = 250.0
    fail_on_focus_lost: bool = True
    flag_video_fallback: bool = True
    max_repeats: Annotated[int, Field(ge=0, le=5)] = 1


class AttentionChecks(Declaration):
    """Instructed ratings put between trials: 'please answer 2 this time'."""

    per_block: Annotated[int, Field(ge=0, le=10)] = 0
    text: Translated = Field(
        default_factory=lambda: {
            "en": "Attention check: please answer **{response}** on this screen.",
            "de": "Aufmerksamkeitsprüfung: Bitte antworten Sie hier mit **{response}**.",
        }
    )


class ScreenFormAnswer(Declaration):
    """Screen out by an answer: one of `refused`, or a number under `below` or over `above`.

    The run ends as soon as the form is sent. A question left open screens nobody out: make it required.
    """

    rule: Literal["form_answer"] = "form_answer"
    form: Name
    field: Name
    refused: tuple[str, ...] = ()
    below: int | None = None
    above: int | None = None

    def screens_out(self, answer: object) -> bool:
        """True where this answer (text, number, or list of texts) ends the run."""
        if isinstance(answer, int):
            low = self.below is not None and answer < self.below
            return low or (self.above is not None and answer > self.above)
        given = answer if isinstance(answer, list) else [answer]
        return any(value in self.refused for value in given)

    def fault(self, forms: Sequence[Form]) -> str | None:
        """What is wrong with this rule, given the declared forms; None where nothing is."""
        form = next((form for form in forms if form.name == self.form), None)
        if form is None:
            return f"no form is called '{self.form}'{did_you_mean(self.form, [form.name for form in forms])}"
        field = next((field for field in form.fields if field.name == self.field), None)
        if field is None:
            near = did_you_mean(self.field, [field.name for field in form.fields])
            return f"form '{form.name}' has no field '{self.field}'{near}"
        return self._fault_of(field)

    def _fault_of(self, field: FormField) -> str | None:
        limits = self.below is not None or self.above is not None
        if isinstance(field, NumberField | LikertField):
            fits = limits and not self.refused
            return None if fits else f"'{field.name}' is a number: give `below` or `above`, not `refused`"
        if not isinstance(field, ChoiceField | MultipleChoiceField):
            return f"'{field.name}' is free text; only choices and numbers can be screened"
        if limits or not self.refused:
            return f"'{field.name}' is a choice: give `refused`, not `below` or `above`"
        values = [option.value for option in field.options]
        wrong = next((value for value in self.refused if value not in values), None)
        return f"'{field.name}' has no option '{wrong}'{did_you_mean(wrong, values)}" if wrong else None


class ScreenAttention(Declaration):
    """Screen out as soon as more than `more_than` attention checks were answered otherwise than asked."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    more_than: Annotated[int, Field(ge=0)] = 0


class ScreenDevice(Declaration):
    """Screen out where browser, screen or window cannot show the clips as [display] asks.

    Without this rule the page explains what is missing, and the link stays open for another device.
    """

    rule: Literal["device"] = "device"


ScreeningRule = Annotated[ScreenFormAnswer | ScreenAttention | ScreenDevice, Field(discriminator="rule")]


class ExcludeIncomplete(Declaration):
    """Leave out participants who did not finish the run."""

    rule: Literal["incomplete"] = "incomplete"


class ExcludeAttention(Declaration):
    """Leave out participants who failed more than `more_than` attention checks."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    more_than: Annotated[int, Field(ge=0)] = 0


class ExcludePlayback(Declaration):
    """Leave out participants with more than this share of plays that were not good."""

    rule: Literal["poor_playback_share"] = "poor_playback_share"
    more_than: Share = 0.2


class ExcludeStraightLining(Declaration):
    """Leave out participants who gave one and the same answer in more than this share of trials."""

    rule: Literal["same_response_share"] = "same_response_share"
    more_than: Share = 0.95


class ExcludeFast(Declaration):
    """Leave out participants whose median response time lies below `below_ms`."""

    rule: Literal["median_response_time"] = "median_response_time"
    below_ms: Annotated[float, Field(gt=0)] = 200.0


class DropFailedPlays(Declaration):
    """Leave out trials whose clip was not shown as declared (verdict failed)."""

    rule: Literal["failed_plays"] = "failed_plays"


class DropSlowTrials(Declaration):
    """Leave out trials answered later than `above_ms` after the clip's end."""

    rule: Literal["slow_trials"] = "slow_trials"
    above_ms: Annotated[float, Field(gt=0)] = 60_000.0


ExclusionRule = Annotated[
    ExcludeIncomplete
    | ExcludeAttention
    | ExcludePlayback
    | ExcludeStraightLining
    | ExcludeFast
    | DropFailedPlays
    | DropSlowTrials,
    Field(discriminator="rule"),
]
