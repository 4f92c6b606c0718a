"""Screening by failed attention checks."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class ScreenAttention(Declaration):
    """Screen out as soon as more than `more_than` attention checks were answered otherwise than asked."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    """Names this rule."""
    more_than: Annotated[int, Field(ge=0)] = 0
    """Failed checks that are still allowed; 0 ends the run at the first."""
