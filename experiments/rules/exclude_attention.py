"""Exclusion by failed attention checks."""

from math import isnan
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.rules.exclusion import LeavesOutRuns, RunTrials, Source


class ExcludeAttention(LeavesOutRuns):
    """Leave out participants who failed more than `more_than` attention checks."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    """Names this rule."""
    more_than: Annotated[int, Field(ge=0)] = 0
    """Failed checks that are still allowed; 0 excludes at the first."""
    needed: ClassVar[tuple[str, ...]] = ("expected_response", "response")
    source: ClassVar[Source] = "attention"

    def excludes(self, run: RunTrials) -> str | None:
        """How many checks were answered otherwise than asked, or not at all."""
        asked = zip(run.numbers("expected_response"), run.numbers("response"), strict=True)
        failed = sum(not isnan(expected) and given != expected for expected, given in asked)
        return f"{failed} failed" if failed > self.more_than else None
