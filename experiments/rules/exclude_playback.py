"""Exclusion by the share of plays that were flagged or failed."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class ExcludePlayback(Declaration):
    """Leave out participants with more than this share of plays that were flagged or failed."""

    rule: Literal["poor_playback_share"] = "poor_playback_share"
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.2
