"""Exclusion by failed attention checks."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class ExcludeAttention(Declaration):
    """Leave out participants who failed more than `more_than` attention checks."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    """Names this rule."""
    more_than: Annotated[int, Field(ge=0)] = 0
    """Failed checks that are still allowed; 0 excludes at the first."""
