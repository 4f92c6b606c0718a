"""One event of one eye."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PhaseFit:
    """What the fit of a blink's phases says of its levels, and how sure it is of the phases.

    Parameters
    ----------
    open_before, open_after : float
        Distance at which the lid rests before and after the blink, in the unit of the series.
    fallen : float
        Distance by which the lid falls below the line from `open_before` to `open_after`.
    down_error_s, up_error_s, duration_error_s : float
        Standard errors of closing, opening and the whole.
    """

    open_before: float
    open_after: float
    fallen: float
    down_error_s: float
    up_error_s: float
    duration_error_s: float


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
    fit : PhaseFit, optional
        What the fit of a blink's phases says besides; None where no curve was fitted.
    is_moved : bool
        Whether a person's review set its onset and end.
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
    fit: PhaseFit | None = None
    is_moved: bool = False
