"""When a blink begins, is closed and ends, between frames: a measured template fitted to its samples.

Crossings of a filtered series move with the rate: a longer filter and fewer frames make a blink longer. The
template's phases do not: at every rate the same curve is fitted to the samples as they are. Its closing and
opening forms are the mean of the recorded profiles; what is fitted is when it begins, how long it closes,
stays and opens, how deep it goes, and the open level before and after.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from stimuli_builder.blinks.events.candidates import Candidate
from stimuli_builder.blinks.events.levels import Depth
from stimuli_builder.blinks.profile import Array

FORMS = Path(__file__).with_name("template.json")
EDGE = 0.05
"""A blink lasts from 5% of its amplitude on the way down to 95% recovery."""
CLOSED = 0.95
"""The closed phase is where 95% of the amplitude is reached."""
BEFORE_S, AFTER_S = 0.25, 0.45
FITTED_FPS = 300
"""Faster series are averaged down to about this rate for the fit; it has seven numbers to find."""
GOOD_MISFIT = 0.06
"""A fit this close needs no second start."""
MISFIT = 0.03
"""Part of the amplitude by which a real blink leaves the template, beside noise."""


@dataclass(frozen=True, eq=False)
class Forms:
    """Closing and opening of the template (0 to 1, over even shares of the phase), and the usual phases.

    Attributes
    ----------
    log_s, log_sd : float64 array
        Mean and spread of the logarithm of closing, closed and opening time in seconds.
    """

    closing: Array
    opening: Array
    log_s: Array
    log_sd: Array


@dataclass(frozen=True)
class Timing:
    """Phases of one blink in seconds from the first sample of its series; `amplitude` is a depth."""

    onset_s: float
    closed_from_s: float
    minimum_s: float
    closed_to_s: float
    end_s: float
    amplitude: float
    misfit: float

    @property
    def closed_s(self) -> float:
        """Length of the closed phase."""
        return self.closed_to_s - self.closed_from_s


@cache
def shipped_forms() -> Forms:
    """The template that ships, made by `measure_template.py` beside it."""
    document = json.loads(FORMS.read_text(encoding="utf-8"))
    return Forms(*(np.array(document[name]) for name in ("closing", "opening", "log_s", "log_sd")))


def timing_of(candidate: Candidate, depth: Depth, forms: Forms | None = None) -> Timing:
    """Fit the template about one dip.

    Minimises sum_k ((r_k - b_k - A T(t_k)) / s)^2 + sum_j ((log p_j - m_j) / sd_j)^2 over the start and the
    phases p of the template T; its amplitude A and the open levels b before and after follow linearly.
    """
    forms = forms or shipped_forms()
    times, values = _window(candidate, depth)
    scale = max(depth.noise, MISFIT * candidate.prominence)
    grid = np.linspace(0, 1, forms.closing.size)

    def curve(p: Array) -> Array:
        down, hold, up = np.exp(p[1:])
        since = times - p[0]
        falling = np.interp(since / down, grid, forms.closing)
        rising = np.interp((since - down - hold) / up, grid, forms.opening)
        return np.asarray(np.where(since <= down + hold, falling, 1 - rising))

    def solved(p: Array) -> tuple[Array, Array]:
        form = curve(p)
        share = np.clip((times - p[0]) / np.exp(p[1:]).sum(), 0, 1)
        columns = np.stack([form, 1 - share, share], axis=1)
        weights, *_ = np.linalg.lstsq(columns, values, rcond=None)
        return columns @ weights, weights

    def rest(p: Array) -> Array:
        return np.concatenate([(solved(p)[0] - values) / scale, (p[1:] - forms.log_s) / forms.log_sd])

    measured, usual = _starts(candidate, depth, forms)
    best = least_squares(rest, measured, method="trf", max_nfev=40)
    if _misfit(*solved(best.x), values) > GOOD_MISFIT:
        again = least_squares(rest, usual, method="trf", max_nfev=40)
        best = again if again.cost < best.cost else best
    fitted, weights = solved(best.x)
    misfit = _misfit(fitted, weights, values)
    return _timing(best.x, forms, float(weights[0]), misfit)


def _misfit(fitted: Array, weights: Array, values: Array) -> float:
    """Root mean square distance of the curve from the samples, as part of its amplitude."""
    return float(np.sqrt(np.mean((fitted - values) ** 2)) / max(abs(float(weights[0])), 1e-6))


def _timing(p: Array, forms: Forms, amplitude: float, misfit: float) -> Timing:
    start, (down, hold, up) = float(p[0]), np.exp(p[1:])
    grid = np.linspace(0, 1, forms.closing.size)

    def reached(form: Array, level: float) -> float:
        return float(np.interp(level, form, grid))

    turn = start + down
    return Timing(
        onset_s=start + down * reached(forms.closing, EDGE),
        closed_from_s=start + down * reached(forms.closing, CLOSED),
        minimum_s=float(turn + hold / 2),
        closed_to_s=float(turn + hold + up * reached(forms.opening, 1 - CLOSED)),
        end_s=float(turn + hold + up * reached(forms.opening, 1 - EDGE)),
        amplitude=amplitude,
        misfit=misfit,
    )


def _window(candidate: Candidate, depth: Depth) -> tuple[Array, Array]:
    """Samples about a dip, thinned by averaging where the series is fast."""
    fps = depth.fps
    first = max(0, int(candidate.left[0] - BEFORE_S * fps))
    last = min(depth.raw.size, int(candidate.right[0] + AFTER_S * fps) + 2)
    step = max(1, round(fps / FITTED_FPS))
    count = max(1, (last - first) // step)
    values: Array = depth.raw[first : first + count * step].reshape(count, step).mean(1)
    times = (first + (step - 1) / 2 + step * np.arange(count)) / fps
    return np.asarray(times, np.float64), np.asarray(values, np.float64)


def _starts(candidate: Candidate, depth: Depth, forms: Forms) -> list[Array]:
    """Where the fit begins: phases from the crossings, and the usual ones about the peak."""
    fps = depth.fps
    down = max((candidate.left[2] - candidate.left[0]) / fps * 1.5, 0.03)
    up = max((candidate.right[0] - candidate.right[2]) / fps * 1.6, 0.05)
    hold = max((candidate.right[2] - candidate.left[2]) / fps - 0.04, 0.004)
    measured = np.array([candidate.left[2] / fps - 0.85 * down, *np.log([down, hold, up])])
    usual = np.array([candidate.peak / fps - float(np.exp(forms.log_s[0])), *forms.log_s])
    return [measured, usual]
