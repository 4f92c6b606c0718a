"""Exclusion by response time."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class ExcludeFast(Declaration):
    """Leave out participants whose median response time lies below `below_ms`."""

    rule: Literal["median_response_time"] = "median_response_time"
    """Names this rule."""
    below_ms: Annotated[float, Field(gt=0)] = 200.0
    """Median response time, in ms from the clip's end, under which a run is left out."""
