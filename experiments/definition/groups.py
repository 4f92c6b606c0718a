"""How participants come into the groups that the factors between participants make."""

from typing import Annotated

from pydantic import Field, StringConstraints

from experiments.base import Declaration

FORM = "form:"
GroupName = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x1f]{1,600}$")]
Answer = Annotated[str, StringConstraints(max_length=200)]
Rule = Annotated[str, StringConstraints(pattern=r"^(turn|link|form:[A-Za-z][A-Za-z0-9_]{0,39})$")]


class Groups(Declaration):
    """How participants come into groups: one for each combination of levels of the factors `between` them.

    A group is named by its levels in factor order, joined by slashes. A place in a group that is given up, or
    screened out, goes to the next participant of that group.
    """

    by: Rule = "turn"
    """`turn`: groups take turns. `link`: each link is for a group. `form:question`: the answer to a required
    choice of a form before the trials decides."""
    quotas: dict[GroupName, Annotated[int, Field(ge=1, le=1_000_000)]] = Field(default_factory=dict)
    """Participants a group takes, by its name; a group without a quota takes any number. Pilot and live runs
    are counted apart, those of simulated people and previews not at all."""
    answers: dict[Answer, GroupName] = Field(default_factory=dict)
    """Group of each answer, where answers (the values of the options) are not named as the groups are."""

    @property
    def question(self) -> str | None:
        """Name of the question that decides; None where no form does."""
        return self.by.removeprefix(FORM) if self.by.startswith(FORM) else None
