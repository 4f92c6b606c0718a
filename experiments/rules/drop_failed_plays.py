"""Trials left out because their clip was not shown as declared."""

from typing import ClassVar, Literal

from experiments.rules.exclusion import LeavesOutTrials


class DropFailedPlays(LeavesOutTrials):
    """Leave out trials whose clip was not shown as declared (verdict failed)."""

    rule: Literal["failed_plays"] = "failed_plays"
    """Names this rule."""
    needed: ClassVar[str] = "verdict"

    def drops(self, value: str | float) -> bool:
        """Whether a play failed."""
        return value == "failed"
