"""When a blink begins, is closed and ends, between frames: a measured template fitted to its samples.

Crossings of a filtered series move with the rate: a longer filter and fewer frames make a blink longer. The
template's phases do not: at every rate the same curve is fitted to the samples as they are. Its closing and
opening forms are the mean of the recorded profiles; what is fitted is when it begins, how long it closes,
stays and opens, how deep it goes, and the open level before and after.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import sqrt
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from stimuli_builder.blinks.events.candidates import SMOOTHING_S, Candidate, Depth, level_crossing
from stimuli_builder.blinks.profile import Array

# Where the lid rests just before and just after a dip, and how far that rest reaches.
#
# A gaze shift near a blink changes the level at which the lid rests. The level before a blink is therefore
# read from the nearest stretch in which the lid rests, not from the most open frame around, and the fit of
# the phases sees no sample beyond that stretch.

CLOSING_S, OPENING_S = 0.6, 1.2
"""A lid comes from rest, and to rest, within this time before and after the half of its way."""
REST_S = (0.05, 0.08)
"""Shortest rest before and after a dip; the slow end of an opening is flat for longer."""
REST_TO_S = (0.25, 0.45)
"""As much of a rest as the fit of the phases sees."""
STILL = 0.06
"""Part of the way back to which the lid moves no more while it rests."""
OUT = 0.15
"""Part of the way up to which a flat stretch is the bottom of the dip, not a rest."""
NOISES = 4.0


@dataclass(frozen=True)
class RestingLid:
    """The resting lid on one side of a dip.

    Parameters
    ----------
    near, far : int
        The frames nearest to the dip and furthest from it.
    level : float
        Depth at which the lid rests.
    """

    near: int
    far: int
    level: float


def rests_about(candidate: Candidate, depth: Depth, bounds: tuple[int, int]) -> tuple[RestingLid, RestingLid]:
    """The rests before and after a dip, neither beyond `bounds` (frames of the piece)."""
    return _rest(candidate, depth, bounds[0], -1), _rest(candidate, depth, bounds[1], 1)


def bounds_of(candidates: Sequence[Candidate], depth: Depth) -> list[tuple[int, int]]:
    """For each dip the widest open frames between it and the dips before and after, else the piece's ends.

    Two dips between which the lid hardly opens are the bottom of one, and do not bound one another.
    """
    last = depth.smooth.size - 1
    before, after = [0] * len(candidates), [last] * len(candidates)
    for number, (first, second) in enumerate(pairwise(candidates)):
        widest = first.peak + int(np.argmin(depth.smooth[first.peak : second.peak + 1]))
        opens = min(first.depth, second.depth) - float(depth.smooth[widest])
        parted = opens >= OUT * min(first.prominence, second.prominence)
        after[number] = widest if parted else -1
        before[number + 1] = widest if parted else -1
    for number in range(1, len(candidates)):
        before[number] = before[number - 1] if before[number] < 0 else before[number]
    for number in range(len(candidates) - 2, -1, -1):
        after[number] = after[number + 1] if after[number] < 0 else after[number]
    return list(zip(before, after, strict=True))


def _rest(candidate: Candidate, depth: Depth, bound: int, step: int) -> RestingLid:
    side, fps, peak = int(step > 0), depth.fps, candidate.peak
    half = (candidate.right if side else candidate.left)[1]
    reach = abs(half - peak) + (CLOSING_S, OPENING_S)[side] * fps
    last = min(abs(bound - peak), int(reach))
    values = depth.smooth[peak - last : peak + 1][::-1] if step < 0 else depth.smooth[peak : peak + last + 1]
    noise = NOISES * _smooth_noise(depth)
    width = max(1, round(REST_S[side] * fps))
    near = _first_rest(values, width, noise)
    if near is None:
        lowest = int(np.argmin(values))
        return RestingLid(peak + step * lowest, peak + step * lowest, float(values[lowest]))
    far = _end_of_rest(values, near, width, max(width, round(REST_TO_S[side] * fps)), noise)
    level = float(np.median(values[near : far + 1]))
    return RestingLid(peak + step * near, peak + step * far, level)


def _smooth_noise(depth: Depth) -> float:
    """Noise of a smoothed frame."""
    return depth.noise / sqrt(max(1.0, SMOOTHING_S * depth.fps))


def _first_rest(values: Array, width: int, noise: float) -> int | None:
    """The first value, outwards from the deepest, from which on the lid rests for `width` frames."""
    if values.size <= width:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(values, width + 1)
    level = windows.mean(1)
    way = values[0] - level
    moves = windows.max(1) - windows.min(1)
    least = max(OUT * float(values[0] - values.min()), 1.5 * noise)
    still = np.flatnonzero((way >= least) & (moves <= STILL * way + noise))
    return int(still[0]) if still.size else None


def _end_of_rest(values: Array, near: int, width: int, longest: int, noise: float) -> int:
    """The last value, outwards, that is as the rest which begins at `near`."""
    level = float(np.median(values[near : near + width + 1]))
    off = np.abs(values[near:] - level) > STILL * (values[0] - level) + noise
    left = np.flatnonzero(off[: longest + 1])
    return min(near + (int(left[0]) - 1 if left.size else longest), values.size - 1)


FORMS = Path(__file__).with_name("template.json")
EDGE = 0.05
"""A blink lasts from 5% of its amplitude on the way down to 95% recovery."""
CLOSED = 0.95
"""The closed phase is where 95% of the amplitude is reached."""
FITTED_FPS = 300
"""Faster series are averaged down to about this rate for the fit; it has seven numbers to find."""
GOOD_MISFIT = 0.06
"""A fit this close needs no second start."""
OUTSIDE_S = 0.01
"""A blink does not reach beyond the rests next to it: by so much more costs as one standard deviation."""
MISFIT = 0.03
"""Part of the amplitude by which a real blink leaves the template, in addition to noise."""

FORM_MEAN = np.array([0.0, 0.0, 0.5, 0.5])
FORM_SD = np.array([0.2, 0.2, 0.5, 0.5])
"""Usual forms of closing and opening and their spread: the logarithm of a power of time, and the part of a
smooth step in the form. People's lids differ; one fixed form made phases of other lids 10-20 ms too long."""


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
class BlinkFit:
    """The fitted curve of a blink, as depths: amplitude, resting levels before and after, misfit.

    `misfit` is the root mean square distance from the samples as part of the amplitude; `errors_s` are the
    standard errors of closing, opening and the whole in seconds.
    """

    amplitude: float
    before: float
    after: float
    misfit: float
    errors_s: tuple[float, float, float]


@dataclass(frozen=True)
class Timing:
    """Phases of one blink in seconds from the first sample of its series; `fitted` where a curve was."""

    onset_s: float
    closed_from_s: float
    minimum_s: float
    closed_to_s: float
    end_s: float
    fitted: BlinkFit | None = None

    @property
    def closed_s(self) -> float:
        """Length of the closed phase."""
        return self.closed_to_s - self.closed_from_s


@cache
def shipped_forms() -> Forms:
    """The template that ships, measured by `bench/lid_event_training.py`."""
    document = json.loads(FORMS.read_text(encoding="utf-8"))
    return Forms(*(np.array(document[name]) for name in ("closing", "opening", "log_s", "log_sd")))


def timing_of(
    candidate: Candidate, depth: Depth, rests: tuple[RestingLid, RestingLid], forms: Forms | None = None
) -> Timing:
    """Fit the template about one dip, between the rests before and after it.

    Minimizes sum_k ((r_k - b_k - A T(t_k)) / s)^2 + sum_j ((log p_j - m_j) / sd_j)^2 over the start, the
    phases and the forms p of the template T, which keeps between the far ends of the rests; its amplitude A
    and the resting levels b before and after follow linearly.
    """
    forms = forms or shipped_forms()
    times, values = _window(rests, depth)
    level = max(rest.level for rest in rests)
    rise = max(candidate.depth - level, 1e-3)
    problem = _Fit(times, values, max(depth.noise / sqrt(_step(depth)), MISFIT * rise), forms)
    # Two starts: a noisy dip's crossings may lie anywhere, while the usual phases are wrong for an unusual
    # blink.
    measured, usual = _starts(candidate, rests, depth, forms)
    best = problem.solve(measured)
    if problem.misfit(best) > GOOD_MISFIT:
        again = problem.solve(usual)
        best = again if problem.cost(again) < problem.cost(best) else best
    return problem.timing(best)


class _Fit:
    """Least squares of the template to one dip; parameters are the start, logarithms of the phases, forms."""

    def __init__(self, times: Array, values: Array, scale: float, forms: Forms) -> None:
        self.times, self.values, self.scale, self.forms = times, values, scale, forms
        self.mean = np.concatenate([forms.log_s, FORM_MEAN])
        self.sd = np.concatenate([forms.log_sd, FORM_SD])

    def curves(self, p: Array) -> Array:
        """(fits, n) template of each row of parameters."""
        since = self.times[None] - p[:, :1]
        down, hold, up = (np.exp(column)[:, None] for column in p[:, 1:4].T)
        falling = _shaped(self.forms.closing, since / down, p[:, 4:5], p[:, 6:7])
        rising = _shaped(self.forms.opening, (since - down - hold) / up, p[:, 5:6], p[:, 7:8])
        return np.asarray(np.where(since <= down + hold, falling, 1 - rising))

    def solved(self, p: Array) -> tuple[Array, Array]:
        """(fits, n) fitted values and (fits, 3) amplitude and levels of each row of parameters."""
        share = np.clip((self.times[None] - p[:, :1]) / np.exp(p[:, 1:4]).sum(1, keepdims=True), 0, 1)
        # Amplitude and both levels are linear: solved inside, they leave seven numbers to search (variable
        # projection).
        columns = np.stack([self.curves(p), 1 - share, share], axis=2)
        # Where a window ends with the blink, the level after it is not determined: the ridge keeps the
        # system solvable.
        square = np.einsum("fni,fnj->fij", columns, columns) + 1e-9 * np.eye(3)
        weights = np.linalg.solve(square, np.einsum("fni,n->fi", columns, self.values)[..., None])[..., 0]
        return np.einsum("fni,fi->fn", columns, weights), weights

    def rest(self, p: Array) -> Array:
        """(fits, residuals) what is minimized."""
        fitted, _ = self.solved(p)
        ends = p[:, 0] + np.exp(p[:, 1:4]).sum(1)
        outside = np.stack([self.times[0] - p[:, 0], ends - self.times[-1]], axis=1)
        return np.concatenate(
            [
                (fitted - self.values) / self.scale,
                (p[:, 1:] - self.mean) / self.sd,
                np.maximum(outside, 0) / OUTSIDE_S,
            ],
            axis=1,
        )

    def slope(self, p: Array) -> Array:
        """(residuals, parameters) derivative of `rest`, all its differences at once."""
        steps = np.full(p.size, 1e-4)
        moved = np.concatenate([p[None], p[None] + np.diag(steps), p[None] - np.diag(steps)])
        rest = self.rest(moved)
        return np.asarray(((rest[1 : p.size + 1] - rest[p.size + 1 :]) / (2 * steps[:, None])).T)

    def solve(self, start: Array) -> Array:
        """The parameters of the best fit near a start."""

        def rest(p: Array) -> Array:
            return np.asarray(self.rest(p[None])[0])

        return np.asarray(least_squares(rest, start, jac=self.slope, method="trf", max_nfev=40).x)

    def cost(self, p: Array) -> float:
        """What is minimized, summed."""
        return float((self.rest(p[None]) ** 2).sum())

    def misfit(self, p: Array) -> float:
        """Root mean square distance of the curve from the samples, as part of its amplitude."""
        fitted, weights = self.solved(p[None])
        return float(np.sqrt(np.mean((fitted[0] - self.values) ** 2)) / max(abs(float(weights[0, 0])), 1e-6))

    def edges(self, p: Array) -> Array:
        """(fits, 5) onset, closed phase, its middle and end of each row of parameters."""
        down, hold, up = np.exp(p[:, 1:4]).T
        turn = p[:, 0] + down
        return np.stack(
            [
                p[:, 0] + down * _reached(self.forms.closing, EDGE, p[:, 4], p[:, 6]),
                p[:, 0] + down * _reached(self.forms.closing, CLOSED, p[:, 4], p[:, 6]),
                turn + hold / 2,
                turn + hold + up * _reached(self.forms.opening, 1 - CLOSED, p[:, 5], p[:, 7]),
                turn + hold + up * _reached(self.forms.opening, 1 - EDGE, p[:, 5], p[:, 7]),
            ],
            axis=1,
        )

    def timing(self, p: Array) -> Timing:
        """The phases, levels and errors of a fit."""
        _, weights = self.solved(p[None])
        amplitude, before, after = weights[0].tolist()
        onset, closed_from, minimum, closed_to, end = self.edges(p[None])[0].tolist()
        return Timing(
            onset,
            closed_from,
            minimum,
            closed_to,
            end,
            BlinkFit(amplitude, before, after, self.misfit(p), self.errors(p)),
        )

    def errors(self, p: Array) -> tuple[float, float, float]:
        """Standard errors of closing, opening and the whole in seconds, by the slope of what is minimized."""
        slope = self.slope(p)
        # A phase that the samples do not determine has its spread from the prior's rows of the slope.
        covariance = np.linalg.pinv(slope.T @ slope)
        moved = p[None] + np.concatenate([1e-4 * np.eye(p.size), -1e-4 * np.eye(p.size)])
        edges = self.edges(moved)
        by = (edges[: p.size] - edges[p.size :]) / 2e-4
        phases = np.stack([by[:, 2] - by[:, 0], by[:, 4] - by[:, 2], by[:, 4] - by[:, 0]])
        variance = np.einsum("ip,pq,iq->i", phases, covariance, phases)
        down, up, whole = np.sqrt(np.maximum(variance, 0)).tolist()
        return down, up, whole


def _shaped(form: Array, share: Array, bend: Array, mixed: Array) -> Array:
    """A form of the template over shares of its phase, bent in time and mixed with a smooth step."""
    x = np.clip(share, 0, 1) ** np.exp(bend)
    nodes = x * (form.size - 1)
    low = np.minimum(nodes.astype(np.intp), form.size - 2)
    measured = form[low] + (nodes - low) * (form[low + 1] - form[low])
    return np.asarray((1 - mixed) * measured + mixed * (1 - np.cos(np.pi * x)) / 2)


def _reached(form: Array, level: float, bend: Array, mixed: Array) -> Array:
    """(fits,) share of the phase at which each bent and mixed form reaches a level."""
    shares = np.linspace(0, 1, 401)
    grid = _shaped(form, shares[None], np.zeros((bend.size, 1)), mixed[:, None])
    # A mix of two rising forms rises but for rounding, which `interp` would not forgive.
    at = np.array([np.interp(level, np.maximum.accumulate(row), shares) for row in grid])
    return np.asarray(at ** np.exp(-bend))


def _step(depth: Depth) -> int:
    """Frames that are averaged for the fit."""
    return max(1, round(depth.fps / FITTED_FPS))


def _window(rests: tuple[RestingLid, RestingLid], depth: Depth) -> tuple[Array, Array]:
    """Samples between the far ends of two rests, thinned by averaging where the series is fast."""
    fps, step = depth.fps, _step(depth)
    first, last = rests[0].far, rests[1].far + 1
    count = max(1, (last - first) // step)
    values: Array = depth.raw[first : first + count * step].reshape(count, step).mean(1)
    times = (first + (step - 1) / 2 + step * np.arange(count)) / fps
    return np.asarray(times, np.float64), np.asarray(values, np.float64)


def _starts(
    candidate: Candidate, rests: tuple[RestingLid, RestingLid], depth: Depth, forms: Forms
) -> list[Array]:
    """Where the fit begins: phases from the crossings of the way to either rest, and the usual ones."""
    fps, peak = depth.fps, candidate.peak
    at = {}
    for step, rest in zip((-1, 1), rests, strict=True):
        way = candidate.depth - rest.level
        for part in (0.2, 0.85):
            at[step, part] = level_crossing(depth, peak, rest.level + part * way, step) / fps
    down = max((at[-1, 0.85] - at[-1, 0.2]) * 1.5, 0.03)
    up = max((at[1, 0.2] - at[1, 0.85]) * 1.6, 0.05)
    hold = max(at[1, 0.85] - at[-1, 0.85] - 0.04, 0.004)
    measured = np.array([at[-1, 0.85] - 0.85 * down, *np.log([down, hold, up]), *FORM_MEAN])
    usual = np.array([peak / fps - float(np.exp(forms.log_s[0])), *forms.log_s, *FORM_MEAN])
    return [measured, usual]
