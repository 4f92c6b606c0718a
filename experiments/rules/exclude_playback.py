"""Exclusion by the share of plays that were flagged or failed."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class ExcludePlayback(Declaration):
    """Leave out participants with more than this share of plays that were flagged or failed."""

    rule: Literal["poor_playback_share"] = "poor_playback_share"
    """Names this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Share of plays, flagged or failed, from 0 to 1, over which a run is left out."""
