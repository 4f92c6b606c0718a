"""The course of one blink: closing, closed and opening phase, smooth at every point."""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
_Number = TypeVar("_Number", float, Array)


@dataclass(frozen=True)
class BlinkShape:
    r"""The lid's course between open and its peak, as a share of the way.

    With s(u) = 10 u^3 - 15 u^4 + 6 u^5 (the minimum-jerk course) on [0, 1] and t from the onset,

    .. math::

        c(t) = s\left((t / T_c)^p\right) \qquad 0 \le t \le T_c \tag{1}

        c(t) = 1 \qquad T_c \le t \le T_c + T_p \tag{2}

        c(t) = 1 - s\left(((t - T_c - T_p) / T_o)^q\right) \qquad \text{then, for } T_o \tag{3}

    T_c, T_p, T_o: closing, closed and opening time in s. p, q: when within its phase the lid is fastest;
    q < 1 is the quick start and the long tail of the opening. c and its first derivative are continuous for
    p, q > 1/3: there is no cusp at the peak. Fitted to the 21 recorded one-eye profiles that ship with
    Palpebra the residual is 0.02 of the way (median); `tools/fit_blink_engine.py` prints it.
    """

    closing_s: float
    closed_s: float
    opening_s: float
    closing_power: float
    opening_power: float

    @property
    def duration_s(self) -> float:
        """From onset to the end of the opening."""
        return self.closing_s + self.closed_s + self.opening_s

    def at(self, time_s: float) -> float:
        """Return c at one moment after the onset (0 outside the blink)."""
        if time_s <= 0.0 or time_s >= self.duration_s:
            return 0.0
        if time_s < self.closing_s:
            return _smooth(math.pow(time_s / self.closing_s, self.closing_power))
        since = time_s - self.closing_s - self.closed_s
        if since <= 0.0:
            return 1.0
        return 1.0 - _smooth(math.pow(min(1.0, since / self.opening_s), self.opening_power))

    def course(self, time_s: Array) -> Array:
        """Return c at many moments (n,)."""
        powers = self.closing_power, self.opening_power
        return lid_course(time_s, self.closing_s, self.closed_s, self.opening_s, *powers)


def lid_course(
    time_s: Array,
    closing_s: Array | float,
    closed_s: Array | float,
    opening_s: Array | float,
    closing_power: float,
    opening_power: float,
) -> Array:
    """Return c of equations 1 to 3 at moments after the onset (n,); durations may differ by moment (n,)."""
    closing = np.clip(time_s / closing_s, 0.0, 1.0) ** closing_power
    opening = np.clip((time_s - closing_s - closed_s) / opening_s, 0.0, 1.0) ** opening_power
    # At its end 1 - s(1) may lie a rounding error below 0.
    return np.maximum(_smooth(closing) * (1.0 - _smooth(opening)), 0.0)


def _smooth(u: _Number) -> _Number:
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))
