"""Trials left out because the answer came late."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.rules.exclusion import LeavesOutTrials


class DropSlowTrials(LeavesOutTrials):
    """Leave out trials answered later than `above_ms` after the clip's end."""

    rule: Literal["slow_trials"] = "slow_trials"
    """Names this rule."""
    above_ms: Annotated[float, Field(gt=0)] = 60_000.0
    """Response time, in ms from the clip's end, over which a trial is left out."""
    needed: ClassVar[str] = "rt"

    def drops(self, value: str | float) -> bool:
        """Whether an answer came late."""
        return float(value) > self.above_ms
