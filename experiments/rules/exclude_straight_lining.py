"""Exclusion by one and the same answer."""

from collections import Counter
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.rules.exclusion import LeavesOutRuns, RunTrials


class ExcludeStraightLining(LeavesOutRuns):
    """Leave out participants who gave one and the same answer in more than this share of trials."""

    rule: Literal["same_response_share"] = "same_response_share"
    """Names this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.95
    """Share of trials with the commonest answer, from 0 to 1, over which a run is left out."""
    needed: ClassVar[tuple[str, ...]] = ("response",)

    def excludes(self, run: RunTrials) -> str | None:
        """The share of the commonest answer."""
        given = run.given("response")
        share = max(Counter(given).values(), default=0) / max(1, len(given))
        return f"{share:.0%} of answers are the same" if share > self.more_than else None
