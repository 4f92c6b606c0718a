"""Exclusion by the share of plays that were flagged or failed."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.rules.exclusion import LeavesOutRuns, RunTrials


class ExcludePlayback(LeavesOutRuns):
    """Leave out participants with more than this share of plays that were flagged or failed."""

    rule: Literal["poor_playback_share"] = "poor_playback_share"
    """Names this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Share of plays, flagged or failed, from 0 to 1, over which a run is left out."""
    needed: ClassVar[tuple[str, ...]] = ("verdict",)

    def excludes(self, run: RunTrials) -> str | None:
        """The share of poor plays."""
        verdicts = run.texts("verdict")
        share = sum(verdict in {"flagged", "failed"} for verdict in verdicts) / len(verdicts)
        return f"{share:.0%} of plays were flagged or failed" if share > self.more_than else None
