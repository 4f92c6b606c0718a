"""Who sees what and in which order: pure functions of declaration, seed and slot."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from experiments.declaration.trial import ClipSpec

# What is stored of a comparison, for designs that choose by it.


class Compared(NamedTuple):
    """Comparisons of two clips, equal in side and answer.

    Attributes
    ----------
    left, right : str
        The clips as lists name them, cell and exemplar joined by a slash.
    winner : {"left", "right", "tie"} or None
        None where the pair was dealt to somebody who is still under way.
    times : int
        How many such comparisons there are.
    """

    left: str
    right: str
    winner: Literal["left", "right", "tie"] | None
    times: int


@dataclass(frozen=True)
class Shown:
    """A clip of a trial and the role in which it is shown."""

    role: str
    clip: ClipSpec


@dataclass(frozen=True)
class Trial:
    """One trial as assigned: practice has block 0; attention checks have no clip.

    Attributes
    ----------
    series : str
        Name of the adaptive series it belongs to, empty where there is none.
    check : int or None
        Which of the study's check clips a motion check shows, from 0.
    """

    kind: Literal["practice", "main", "attention", "check"]
    block: int
    block_label: str
    shown: tuple[Shown, ...] = ()
    expected_response: int | None = None
    series: str = ""
    check: int | None = None

    @property
    def clip(self) -> ClipSpec | None:
        """The clip of a trial that shows one; None for checks."""
        return self.shown[0].clip if self.shown else None
