"""One event of one eye."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LidEvent:
    """One event of one eye.

    Parameters
    ----------
    kind : str
        "blink", "squint", "gaze_shift" or "closed_eye" (closed phase of 0.5 s or more).
    probability : float
        The classifier's, of this kind among the four and 'nothing'; 1 where `with_long_closures` tells.
    frame : int
        Deepest frame of the series.
    onset_s, closed_from_s, minimum_s, closed_to_s, end_s : float
        From 5% of the amplitude over the closed phase (95% of it) to 95% recovery, from the first frame.
    depth : float
        Greatest depth as part of the opening.
    """

    kind: str
    probability: float
    frame: int
    onset_s: float
    closed_from_s: float
    minimum_s: float
    closed_to_s: float
    end_s: float
    depth: float
