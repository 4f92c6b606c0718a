"""Exclusion by response time."""

from statistics import median
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.rules.exclusion import LeavesOutRuns, RunTrials


class ExcludeFast(LeavesOutRuns):
    """Leave out participants whose median response time lies below `below_ms`."""

    rule: Literal["median_response_time"] = "median_response_time"
    """Names this rule."""
    below_ms: Annotated[float, Field(gt=0)] = 200.0
    """Median response time, in ms from the clip's end, under which a run is left out."""
    needed: ClassVar[tuple[str, ...]] = ("rt",)

    def excludes(self, run: RunTrials) -> str | None:
        """The median response time."""
        times = run.given("rt")
        middle = median(times) if times else self.below_ms
        return f"median {middle:.0f} ms" if middle < self.below_ms else None
