"""Rules declared before the data: playback quality, exclusions, attention checks."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration, Translated

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
