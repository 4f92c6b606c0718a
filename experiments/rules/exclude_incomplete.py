"""Exclusion of participants who did not finish."""

from typing import Literal

from experiments.base import Declaration


class ExcludeIncomplete(Declaration):
    """Leave out participants who did not finish the run."""

    rule: Literal["incomplete"] = "incomplete"
    """Names this rule."""
