"""What is stored of a comparison, for designs that choose by it."""

from typing import Literal, NamedTuple


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
