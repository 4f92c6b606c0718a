"""Rules declared before data collection: playback, attention checks, screening, warnings, exclusions.

A new rule is a class and its place in a union below. Exclusion rules and warnings decide by a method. Every
use of screening rules matches the union exhaustively (`assert_never`), so that type checking names a rule
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
    ScreenByBT500,
    ScreenByP913,
)
from experiments.rules.playback import PlaybackRules
from experiments.rules.screening import AttentionChecks, ScreenAttention, ScreenDevice, ScreenFormAnswer
from experiments.rules.warnings import WarnFast, WarnPattern, WarnSameAnswer

ScreeningRule = Annotated[ScreenFormAnswer | ScreenAttention | ScreenDevice, Field(discriminator="rule")]
"""Ends a run early."""

WarningRule = Annotated[WarnSameAnswer | WarnPattern | WarnFast, Field(discriminator="rule")]
"""Detects careless responding in the last answers of a run."""

ExclusionRule = Annotated[
    ExcludeIncomplete
    | ExcludeAttention
    | ExcludePlayback
    | ExcludeStraightLining
    | ExcludeFast
    | ExcludeEvidence
    | DropFailedPlays
    | DropSlowTrials
    | ScreenByBT500
    | ScreenByP913,
    Field(discriminator="rule"),
]
"""Excludes a participant's run, or single trials, from the analysis."""

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
    "ScreenByBT500",
    "ScreenByP913",
    "ScreenDevice",
    "ScreenFormAnswer",
    "ScreeningRule",
    "WarnFast",
    "WarnPattern",
    "WarnSameAnswer",
    "WarningRule",
]
