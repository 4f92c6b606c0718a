"""Exclusion of participants who did not finish."""

from typing import ClassVar, Literal

from experiments.rules.exclusion import LeavesOutRuns, RunTrials, Source


class ExcludeIncomplete(LeavesOutRuns):
    """Leave out participants who did not finish the run."""

    rule: Literal["incomplete"] = "incomplete"
    """Names this rule."""
    needed: ClassVar[tuple[str, ...]] = ("run_status",)
    source: ClassVar[Source] = "rows"

    def excludes(self, run: RunTrials) -> str | None:
        """The state of a run that is not complete."""
        status = run.texts("run_status")[0]
        return None if status in {"complete", ""} else f"run is {status}"
