"""Exclusion by one and the same answer."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class ExcludeStraightLining(Declaration):
    """Leave out participants who gave one and the same answer in more than this share of trials."""

    rule: Literal["same_response_share"] = "same_response_share"
    """Names this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.95
    """Share of trials with the commonest answer, from 0 to 1, over which a run is left out."""
