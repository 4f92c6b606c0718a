"""Trials left out because their clip was not shown as declared."""

from typing import Literal

from experiments.base import Declaration


class DropFailedPlays(Declaration):
    """Leave out trials whose clip was not shown as declared (verdict failed)."""

    rule: Literal["failed_plays"] = "failed_plays"
    """Names this rule."""
