"""Attention checks: instructed ratings between the trials."""

from typing import Annotated

from pydantic import Field

from experiments.base import Declaration, Translated


class AttentionChecks(Declaration):
    """Instructed ratings put between trials: 'please answer 2 this time'."""

    per_block: Annotated[int, Field(ge=0, le=10)] = 0
    """Checks in each block, at random places but never first. They are stored with kind `attention`."""
    text: Translated = Field(
        default_factory=lambda: {
            "en": "Attention check: please answer **{response}** on this screen.",
            "de": "Aufmerksamkeitsprüfung: Bitte antworten Sie hier mit **{response}**.",
        }
    )
    """Markdown of the check, `{response}` standing for the answer asked for."""
