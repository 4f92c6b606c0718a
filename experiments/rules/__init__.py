"""Rules declared before the data, one file a rule: playback, attention checks, screening, warnings,
exclusions.

A new rule is its file and its place in a union below. Exclusion rules and warnings judge by a method of their
own; every use of screening rules matches the union to its end (`assert_never`). Type-checking names a rule
that nothing applies.
"""

from typing import Annotated

from pydantic import Field

from experiments.rules.attention import AttentionChecks
from experiments.rules.drop_failed_plays import DropFailedPlays
from experiments.rules.drop_slow_trials import DropSlowTrials
from experiments.rules.exclude_attention import ExcludeAttention
from experiments.rules.exclude_evidence import ExcludeEvidence
from experiments.rules.exclude_fast import ExcludeFast
from experiments.rules.exclude_incomplete import ExcludeIncomplete
from experiments.rules.exclude_playback import ExcludePlayback
from experiments.rules.exclude_straight_lining import ExcludeStraightLining
from experiments.rules.playback import PlaybackRules
from experiments.rules.screen_attention import ScreenAttention
from experiments.rules.screen_device import ScreenDevice
from experiments.rules.screen_form_answer import ScreenFormAnswer
from experiments.rules.warn_fast import WarnFast
from experiments.rules.warn_pattern import WarnPattern
from experiments.rules.warn_same_answer import WarnSameAnswer

ScreeningRule = Annotated[ScreenFormAnswer | ScreenAttention | ScreenDevice, Field(discriminator="rule")]
"""Ends a run while it goes on."""

WarningRule = Annotated[WarnSameAnswer | WarnPattern | WarnFast, Field(discriminator="rule")]
"""Sees a lapse of care in the last answers of a run that goes on."""

ExclusionRule = Annotated[
    ExcludeIncomplete
    | ExcludeAttention
    | ExcludePlayback
    | ExcludeStraightLining
    | ExcludeFast
    | ExcludeEvidence
    | DropFailedPlays
    | DropSlowTrials,
    Field(discriminator="rule"),
]
"""Leaves out a participant's run, or single trials, when the study is analysed."""

__all__ = [
    "AttentionChecks",
    "DropFailedPlays",
    "DropSlowTrials",
    "ExcludeAttention",
    "ExcludeEvidence",
    "ExcludeFast",
    "ExcludeIncomplete",
    "ExcludePlayback",
    "ExcludeStraightLining",
    "ExclusionRule",
    "PlaybackRules",
    "ScreenAttention",
    "ScreenDevice",
    "ScreenFormAnswer",
    "ScreeningRule",
    "WarnFast",
    "WarnPattern",
    "WarnSameAnswer",
    "WarningRule",
]
