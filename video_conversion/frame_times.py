"""Frames on a grid of equal times: pure functions of the times at which frames begin."""

from bisect import bisect_right
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from statistics import median

STANDARD_RATES = tuple(
    Fraction(rate)
    for rate in (
        Fraction(24000, 1001), 24, 25, Fraction(30000, 1001), 30, 48, 50,
        Fraction(60000, 1001), 60, 100, 120, 144, 200, 240,
    )
)  # fmt: skip
TOLERANCE = 0.25
"""Of the time between frames: by so much a frame may begin off the grid and its rate count as constant.
Containers round times to a millisecond, which at 240 frames per second is 0.12 of it."""
SNAP = 0.01
LONE_FRAME_RATE = Fraction(25)


def constant_rate(times_s: Sequence[float], candidates: Sequence[Fraction | None]) -> Fraction | None:
    """The first candidate rate on whose grid every frame begins; None where none fits.

    Parameters
    ----------
    times_s : sequence of float, shape (frames,)
        When each frame begins, ascending, in s.
    candidates : sequence of Fraction or None
        Frames per second, as the container says them; the mean rate is tried last.

    Returns
    -------
    Fraction or None
        Frames per second.
    """
    if len(times_s) < 2:
        return next((rate for rate in candidates if rate), LONE_FRAME_RATE)
    span = times_s[-1] - times_s[0]
    if span <= 0:
        return None
    mean = snapped((len(times_s) - 1) / span)
    fitting = (rate for rate in (*candidates, mean) if rate and _fits(times_s, rate))
    return next(fitting, None)


def _fits(times_s: Sequence[float], rate: Fraction) -> bool:
    step = float(1 / rate)
    off = (abs(time - times_s[0] - number * step) for number, time in enumerate(times_s))
    return max(off) <= TOLERANCE * step


def snapped(rate: float) -> Fraction:
    """The standard rate nearest to `rate` where it is within 1 %, else the rate to three decimals."""
    nearest = min(STANDARD_RATES, key=lambda standard: abs(float(standard) - rate))
    return nearest if abs(float(nearest) - rate) <= SNAP * rate else Fraction(round(rate * 1000), 1000)


def typical_rate(times_s: Sequence[float]) -> Fraction:
    """Frames per second of a variable rate: the inverse of the median time between frames."""
    steps = [later - earlier for earlier, later in pairwise(times_s) if later > earlier]
    return snapped(1 / median(steps)) if steps else LONE_FRAME_RATE


def frame_map(times_s: Sequence[float], end_s: float, rate: Fraction) -> tuple[int, ...]:
    """The frame of the original that each frame of the clip shows, both from 0.

    Frame k of the clip, on screen from k / f to (k + 1) / f after the start, shows the frame of the original
    that is there at the middle of that time:

    .. math:: m_k = \\max \\{ i : t_i - t_0 \\le (k + 1/2) / f \\}                                  (1)

    with t_i the time at which frame i begins and f the clip's rate. There are
    round((t_e - t_0) f) of them, at least one, with t_e the time at which the last frame ends.

    Parameters
    ----------
    times_s : sequence of float, shape (frames,)
        When each frame begins, ascending, in s; at least one.
    end_s : float
        When the last frame ends, in s.
    rate : Fraction
        Frames per second of the clip.

    Returns
    -------
    tuple of int
        Ascending, not below 0, below the number of frames.
    """
    start, step = times_s[0], float(1 / rate)
    count = max(1, round((end_s - start) / step))
    begins = [time - start for time in times_s]
    return tuple(max(0, bisect_right(begins, (number + 0.5) * step) - 1) for number in range(count))
