"""Trials left out because the answer came late."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class DropSlowTrials(Declaration):
    """Leave out trials answered later than `above_ms` after the clip's end."""

    rule: Literal["slow_trials"] = "slow_trials"
    """Names this rule."""
    above_ms: Annotated[float, Field(gt=0)] = 60_000.0
    """Response time, in ms from the clip's end, over which a trial is left out."""
