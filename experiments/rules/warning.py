"""What a rule of [[warnings.rules]] is: it sees a lapse of care in the last answers of a run that goes on.

A rule is one file: its keys, and a method that judges. The server asks it with each answer to a main trial,
whatever the kind of trial.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from experiments.base import Declaration, Translated


@dataclass(frozen=True)
class GivenAnswer:
    """One answer to a main trial: as text that is equal for equal answers, and its response time in ms."""

    value: str
    rt: float | None


class Warns(Declaration):
    """A rule about careless answers: its method `lapses(given: Sequence[GivenAnswer]) -> bool` judges.

    Attributes
    ----------
    answers : int
        How many answers, the latest last, it is given; with fewer it is not asked.
    text : Translated
        What the participant then reads.
    """

    answers: int
    text: Translated


def follow_a_cycle(given: Sequence[GivenAnswer], length: int) -> bool:
    """True where every answer equals the one `length` answers before."""
    values = [one.value for one in given]
    return len(values) > length and values[length:] == values[:-length]
