"""How long data of persons are kept."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.base import Declaration

Days = Annotated[int, Field(ge=1, le=36_500)]


class Retention(Declaration):
    """How long data of persons are kept, in days after a visit's last sign of life.

    Then the server erases them by itself, within the hour.

    A visit keeps to what was declared when it began, or to what is declared since where that is shorter. A
    period without a number is without an end.
    """

    identifiers_days: Days | None = None
    """Days after which it is erased who took part: recruiters' ids, what else the address said, completion
    codes and labels of personal links. Answers stay, under the pseudonym."""
    unfinished_days: Days | None = None
    """Days after which visits that were not completed are erased, answers and all."""
    answers_days: Days | None = None
    """Days after which every visit is erased, answers and all; a row without content stays for the counts."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.answers_days is None:
            return self
        for name in ("identifiers_days", "unfinished_days"):
            days = getattr(self, name)
            if days is not None and days > self.answers_days:
                raise ValueError(
                    f"{name} is {days}, but after answers_days ({self.answers_days}) nothing is left; "
                    "expected at most as many"
                )
        return self

    def shorter(self, other: "Retention") -> "Retention":
        """The shorter of each period; one that is declared is shorter than none.

        Parameters
        ----------
        other : Retention
            What is declared since.
        """
        periods = {
            name: _shorter(getattr(self, name), getattr(other, name)) for name in type(self).model_fields
        }
        return self.model_copy(update=periods)


def _shorter(one: int | None, other: int | None) -> int | None:
    return min((days for days in (one, other) if days is not None), default=None)
