"""What is stored of a comparison, for designs that choose by it."""

from typing import Literal, NamedTuple


class Compared(NamedTuple):
    """Comparisons of two clips, equal in side and answer.

    left, right: the clips as lists name them, cell and exemplar joined by a slash. winner: None where the
    pair was dealt to somebody who is still under way. times: how many such comparisons there are.
    """

    left: str
    right: str
    winner: Literal["left", "right", "tie"] | None
    times: int
