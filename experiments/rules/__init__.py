"""Rules declared before the data, one file a rule: playback, attention checks, screening, warnings,
exclusions.

A new rule is its file and its place in a union below. Exclusion rules and warnings judge by a method of their
own; every use of screening rules matches the union to its end (`assert_never`). Type-checking names a rule
that nothing applies.
"""

from typing import Annotated

from pydantic import Field

from experiments.rules.exclusions import (
    DropFailedPlays,
    DropSlowTrials,
    ExcludeAttention,
    ExcludeEvidence,
    ExcludeFast,
    ExcludeIncomplete,
    ExcludePlayback,
    ExcludeStraightLining,
)
from experiments.rules.playback import PlaybackRules
from experiments.rules.screening import AttentionChecks, ScreenAttention, ScreenDevice, ScreenFormAnswer
from experiments.rules.warnings import WarnFast, WarnPattern, WarnSameAnswer

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
