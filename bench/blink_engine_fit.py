"""Fit the blink engine's defaults and write blink_engine/defaults.json, or print how well they fit.

    python -m bench.blink_engine_fit --data FOLDER [--write]

FOLDER holds blink_series/blinking_full_blinking.xlsx (JeFaPaTo's test files, MIT): the blink table of a
20-minute recording. Its first half is fitted, its second half tested. The courses of single blinks are
fitted to the profiles that ship with Palpebra.

Intervals between blinks as a law that drifts: fitted by maximum likelihood, and what the fit leaves open.

With l_k the logarithm of interval k,

    l_k = mu + d_k + e_k                                (1)
    d_k = phi d_(k-1) + sqrt(1 - phi^2) w z_k           (2)

e_k: the logarithm of a gamma or log-normal number (`blink_engine.laws.Law`), its mean taken away; z_k
standard normal; w and phi are the drift's spread and what is kept of it (`blink_engine.parameters.Drift`). A
slow drift, another d with its own w and phi, is not fitted: its size over an hour is published.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import optimize, special

from blink_engine.laws import Law
from blink_engine.plan import BlinkShape
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import BlinkProfile

Array = npt.NDArray[np.float64]
Kind = Literal["gamma", "lognormal"]
GRID = 61
GRID_SPREADS = 4.0
REFERENCE = 40_000


@dataclass(frozen=True)
class IntervalFit:
    """The law's kind and spread (gamma: its shape), mu, w and phi of equations 1 and 2, and the likelihood.

    Attributes
    ----------
    slow_spread, slow_kept : float
        w and phi of the slow drift.
    """

    kind: Kind
    spread: float
    location: float
    drift: float
    kept: float
    log_likelihood: float = 0.0
    slow_spread: float = 0.0
    slow_kept: float = 0.0

    def sample(self, count: int, times: int, rng: np.random.Generator) -> Array:
        """Logarithms of intervals (times, count), each row a separate recording."""
        size = (times, count)
        if self.kind == "gamma":
            own = np.log(rng.gamma(self.spread, 1.0, size)) - special.digamma(self.spread)
        else:
            own = rng.normal(0.0, self.spread, size)
        drift = _wandering(self.drift, self.kept, count, times, rng)
        return self.location + own + drift + _wandering(self.slow_spread, self.slow_kept, count, times, rng)


def _wandering(spread: float, kept: float, count: int, times: int, rng: np.random.Generator) -> Array:
    """Courses of d by equation 2, (times, count)."""
    course = np.empty((times, count))
    course[:, 0] = rng.normal(0.0, spread, times)
    step = spread * np.sqrt(1.0 - kept**2)
    for k in range(1, count):
        course[:, k] = kept * course[:, k - 1] + rng.normal(0.0, step, times)
    return course


def fit_intervals(intervals_s: Array, kind: Kind = "gamma", drifts: bool = True) -> IntervalFit:
    """Fit equations 1 and 2 to intervals (n,) in their order; without `drifts` equation 1 with d = 0."""
    logs = np.log(intervals_s)

    def natural(values: Array) -> IntervalFit:
        location, spread, drift, kept = (float(value) for value in values)
        return IntervalFit(
            kind, np.exp(spread), location, np.exp(drift) if drifts else 1e-3, special.expit(kept)
        )

    def loss(values: Array) -> float:
        fit = natural(values)
        sensible = fit.drift < 3.0 and fit.kept < 0.9995
        return -_log_likelihood(logs, fit) if sensible else 1e9

    first = np.log(3.0 if kind == "gamma" else 0.6)
    starts = [np.array([logs.mean(), first, np.log(0.5), kept]) for kept in (1.0, 3.0)]
    fits = [
        optimize.minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
        for start in starts
    ]
    best = min(fits, key=lambda one: float(one.fun))
    return replace(natural(best.x), log_likelihood=-float(best.fun))


def _density(fit: IntervalFit) -> Callable[[Array], Array]:
    """Density of l_k - d_k."""
    if fit.kind == "lognormal":
        scale = fit.spread * np.sqrt(2.0 * np.pi)
        return lambda logs: np.exp(-0.5 * ((logs - fit.location) / fit.spread) ** 2) / scale
    shape, centre = fit.spread, fit.location - special.digamma(fit.spread)
    return lambda logs: np.exp(
        shape * (logs - centre) - np.exp(np.minimum(logs - centre, 50.0)) - special.gammaln(shape)
    )


def _log_likelihood(logs: Array, fit: IntervalFit) -> float:
    """By a filter over a grid of d: `weights` (GRID,) are the probabilities of d_k, given l_1 to l_(k-1)."""
    grid = np.linspace(-GRID_SPREADS, GRID_SPREADS, GRID) * fit.drift
    step = fit.drift * np.sqrt(1.0 - fit.kept**2)
    moves = np.exp(-0.5 * ((grid[None, :] - fit.kept * grid[:, None]) / step) ** 2)
    moves /= moves.sum(axis=1, keepdims=True)
    weights = np.exp(-0.5 * (grid / fit.drift) ** 2)
    weights /= weights.sum()
    likelihoods = np.maximum(_density(fit)(logs[:, None] - grid[None, :]), 1e-300)
    total = 0.0
    for likelihood in likelihoods:
        joint = weights * likelihood
        seen = joint.sum()
        total += np.log(seen)
        weights = (joint / seen) @ moves
    return float(total)


def held_out_p(fit: IntervalFit, fitted_s: Array, kept_s: Array, times: int = 2000, seed: int = 1) -> float:
    """How often one half of a recording that the fit draws lies as far from the other as these two.

    The distance is Kolmogorov's, of the half kept out about the fitted law, laid on the fitted half's mean.
    The usual table of p takes intervals for independent of each other and the mean for known. Neither holds:
    ten minutes hold few stretches of many and of few blinks, so that the mean of ten minutes says less than
    their number of blinks suggests. Here both halves are drawn in one, again and again.
    """
    count, rng = fitted_s.size, np.random.default_rng(seed)
    law = np.sort(fit.sample(1, REFERENCE, rng).ravel() - fit.location)

    def distances(logs: Array) -> Array:
        means = logs[:, :count].mean(axis=1, keepdims=True)
        shares = np.searchsorted(law, np.sort(logs[:, count:], axis=1) - means) / REFERENCE
        steps = np.arange(kept_s.size + 1) / kept_s.size
        return np.asarray(np.maximum(shares - steps[:-1], steps[1:] - shares).max(axis=1))

    drawn = fit.sample(count + kept_s.size, times, rng)
    seen = distances(np.log(np.concatenate([fitted_s, kept_s]))[None, :])
    return float(np.mean(distances(drawn) >= seen))


def with_slow_drift(fit: IntervalFit, kept: float, rate: float, variation: float) -> IntervalFit:
    """Add a slow drift with which an hour's bins of 5 minutes vary as much as was published.

    Parameters
    ----------
    rate : float
        Blinks a minute of the people in that study.
    variation : float
        Their coefficient of variation.
    """

    def miss(spread: float) -> float:
        return bins_variation(replace(fit, slow_spread=spread, slow_kept=kept), rate) - variation

    if miss(0.0) >= 0.0:
        return replace(fit, slow_kept=kept)
    return replace(fit, slow_spread=float(optimize.brentq(miss, 0.0, 1.0, xtol=1e-3)), slow_kept=kept)


def bins_variation(fit: IntervalFit, rate: float, times: int = 400) -> float:
    """Coefficient of variation of the blinks in twelve bins of 5 minutes, mean over so many hours.

    `rate` in blinks a minute is the long-term mean, whatever the fit's location.
    """
    intervals = np.exp(fit.sample(int(60 * rate * 2.5), times, np.random.default_rng(2)))
    onsets = np.cumsum(intervals * 60.0 / rate / intervals.mean(), axis=1)
    bins = np.array([np.histogram(row, bins=np.arange(0, 3601, 300))[0] for row in onsets])
    return float(np.mean(bins.std(axis=1, ddof=1) / bins.mean(axis=1)))


ROOT = Path(__file__).resolve().parent.parent
DEFAULTS = ROOT / "blink_engine" / "defaults.json"
RECORDING_FPS, PROFILE_FPS = 240.0, 300.0
COMPLETE_FROM = 0.95

BENTIVOGLIO = "Bentivoglio et al. 1997, Movement Disorders 12(6), 1028-1034: means of 150 healthy people"
TSUBOTA = "Tsubota & Nakamori 1993, New England Journal of Medicine 328(8), 584: mean at a display terminal"
RATES_PER_MINUTE = {"rest": 17.0, "reading": 4.5, "screen": 7.0, "speaking": 26.0, "listening": 17.0}
SLOW_KEPT = 0.994
"""170 blinks, which are 10 minutes at 17 a minute, keep 1/e of it."""
HOUR = {"rate": 19.8, "variation": 0.296}
RECORDED = "blink table of a 20-minute recording (JeFaPaTo test files, MIT)"
SHIPPED = "the 21 one-eye profiles that ship with Palpebra (stimuli_builder/blinks/library)"
SOURCES = {
    "intervals.rest": f"mean: {BENTIVOGLIO}, 17 a minute; gamma shape: first half of the {RECORDED}",
    "intervals.reading": f"mean: {BENTIVOGLIO}, 4.5 a minute; shape as at rest",
    "intervals.speaking": f"mean: {BENTIVOGLIO}, 26 a minute; shape as at rest",
    "intervals.screen": f"mean: {TSUBOTA}, 7 a minute; shape as at rest",
    "intervals.listening": "no agreed figure; the rate at rest is taken",
    "drift": f"first half of the {RECORDED}, by maximum likelihood with the shape "
    "(bench/blink_engine_fit.py)",
    "slow_drift": "spread: with it blinks in bins of 5 minutes vary by 29.6% over an hour, as those of 10 "
    "people at 19.8 a minute did: Garcia, Pinto, Barbosa & Cruz 2011, Investigative Ophthalmology & Visual "
    "Science 52(6), 3419-3424 (the variation in their meeting abstract); kept: chosen, for a drift over 10 "
    "minutes",
    "profile": f"fitted to {SHIPPED}",
    "profile.delay_s": f"between the eyes' apexes in the {RECORDED}, half the range of its middle 68%",
    "profile.asymmetry": f"between the eyes' peak closures of one blink, {SHIPPED}",
    "profile.complete_share": f"share of peak closures from 0.95 on, {SHIPPED}",
    "profile.long_closed_s": "so that a long blink lasts 607 ms in the median, as Hoemke, Holler & Levinson "
    "2018, PLoS ONE 13(12), e0208030, showed them; none come unless asked for: Oetringer 2021 did not find "
    "their effect on a robot",
    "profile.double_share": "0: the intervals as recorded hold double blinks already (4% below 0.7 s)",
    "responses.gaze_shift": "Evinger et al. 1994, Experimental Brain Research 100(2), 337-344: 97% of shifts "
    "above 33 degrees, beginning with the movement; the midpoint at 17 degrees is where their head turns "
    "began to be answered always with the eyes closed",
    "responses.speech": "Ford, Bugmann & Culverhouse 2013, International Journal of Humanoid Robotics 10(1), "
    "1350006: 71% of blinks within 375 ms of communicative events (23% by chance)",
    "gaze_closure_per_deg": "chosen: the opening narrows to about half at 30 degrees down",
    "squint_closure": "chosen",
}


def intervals_of(data: Path, eye: str = "left") -> Array:
    """Return the intervals between blinks in s."""
    apexes = _recording(data, eye)
    return np.asarray(np.diff(apexes) / RECORDING_FPS)


def fitted_half(data: Path) -> IntervalFit:
    """Return the law of the first half of the recording and its drift, with the published slow drift.

    Of the right eye, in which more blinks were detected: one that is missed makes one interval of two.
    """
    intervals = intervals_of(data, "right")
    return with_slow_drift(fit_intervals(intervals[: intervals.size // 2]), SLOW_KEPT, **HOUR)


def _recording(data: Path, eye: str) -> Array:
    table = pd.read_excel(data / "blink_series/blinking_full_blinking.xlsx", sheet_name=f"blinking {eye} eye")
    return table["apex_frame"].to_numpy(dtype=np.float64)


def delay_between_eyes(data: Path) -> float:
    """Half the range of the middle 68% of right minus left apex in s, over blinks within 50 ms."""
    left, right = _recording(data, "left"), _recording(data, "right")
    nearest = right[np.abs(right[None, :] - left[:, None]).argmin(axis=1)]
    delays = (nearest - left)[np.abs(nearest - left) <= 0.05 * RECORDING_FPS] / RECORDING_FPS
    low, high = np.percentile(delays, [16, 84])
    return float(high - low) / 2


def fitted_shapes(profiles: Sequence[BlinkProfile] | None = None) -> tuple[Array, Array]:
    """(n, 5) closing, closed, opening time and both powers of each profile; residuals (n,).

    Without `profiles` the 21 shipped ones.
    """
    rows, residuals = [], []
    for profile in load_library() if profiles is None else profiles:
        course = np.clip(profile.closure, 0.0, None) / profile.amplitude
        fit = _fit_course(course, float(np.argmax(course)) / PROFILE_FPS)
        rows.append(fit.x[1:])
        residuals.append(float(np.sqrt(2 * fit.cost / course.size)))
    return np.array(rows), np.array(residuals)


def _fit_course(course: Array, peak_s: float) -> Any:
    time = np.arange(course.size) / PROFILE_FPS

    def residual(values: Array) -> Array:
        onset, *shape = values
        return BlinkShape(*shape).course(time - onset) - course

    bounds = ([-0.3, 0.02, 0.0, 0.04, 0.5, 0.4], [0.4, 0.4, 0.3, 0.8, 2.0, 1.2])
    starts = [[max(0.0, peak_s - closing), closing, 0.01, 0.2, 1.0, 0.6] for closing in (0.06, 0.1, 0.15)]
    fits = [optimize.least_squares(residual, start, bounds=bounds) for start in starts]
    return min(fits, key=lambda fit: fit.cost)


def profile_defaults(data: Path) -> dict[str, Any]:
    """Return the profile model's defaults."""
    pairs = [p.closure_other for p in load_library(paired=True)]
    asymmetry = np.std(
        [
            p.amplitude - float(np.max(o))
            for p, o in zip(load_library(paired=True), pairs, strict=True)
            if o is not None
        ]
    )
    courses = course_defaults(load_library())
    return {
        **{name: courses[name] for name in ("closing_s", "opening_s", "closed_s")},
        "long_closed_s": {"kind": "lognormal", "median": 0.29, "spread": 0.2},
        **{name: courses[name] for name in ("closing_power", "opening_power", "complete_share")},
        "long_share": 0.0,
        "double_share": 0.0,
        **{name: courses[name] for name in ("partial_logit_median", "partial_logit_spread")},
        "asymmetry": round(float(asymmetry), 3),
        "delay_s": round(delay_between_eyes(data), 4),
        "lower_up": 1.0,
        "lower_in": 1.0,
    }


def course_defaults(profiles: Sequence[BlinkProfile]) -> dict[str, Any]:
    """What the profile model takes from single blinks: durations, powers and peak closures."""
    shapes, _ = fitted_shapes(profiles)
    closing, closed, opening, closing_power, opening_power = shapes.T
    peaks = np.array([profile.amplitude for profile in profiles])
    partial = peaks[peaks < COMPLETE_FROM]
    logits = np.log(partial / (1 - partial))
    held = closed[(peaks >= COMPLETE_FROM) & (closed > 0.002)]
    return {
        "closing_s": _lognormal(closing),
        "opening_s": _lognormal(opening),
        "closed_s": _lognormal(held),
        "closing_power": round(float(np.median(closing_power)), 3),
        "opening_power": round(float(np.median(opening_power)), 3),
        "complete_share": round(float(np.mean(peaks >= COMPLETE_FROM)), 3),
        "partial_logit_median": round(float(np.median(logits)), 3),
        "partial_logit_spread": round(float(np.std(logits, ddof=1)), 3),
    }


def half_widths_s(data: Path, eye: str = "left") -> Array:
    """Return how long each blink of the recording is at half its depth or deeper, in s."""
    table = pd.read_excel(data / "blink_series/blinking_full_blinking.xlsx", sheet_name=f"blinking {eye} eye")
    return table["peak_internal_width"].to_numpy(dtype=np.float64) / RECORDING_FPS


def _lognormal(values: Array) -> dict[str, Any]:
    logs = np.log(values)
    return {
        "kind": "lognormal",
        "median": round(float(np.exp(np.median(logs))), 4),
        "spread": round(float(np.std(logs, ddof=1)), 3) if logs.size > 1 else 0.0,
    }


def _gamma_law(mean: float, shape: float) -> dict[str, Any]:
    law = Law("gamma", 1.0, shape).with_mean(mean)
    return {"kind": law.kind, "median": round(law.median, 4), "spread": shape}


def defaults(data: Path) -> dict[str, Any]:
    """Return what defaults.json holds."""
    fit = fitted_half(data)
    shape, drift, slow = (round(one, 3) for one in (fit.spread, fit.drift, fit.slow_spread))
    drifting = float(np.exp((drift**2 + slow**2) / 2))
    laws = {state: _gamma_law(60.0 / rate / drifting, shape) for state, rate in RATES_PER_MINUTE.items()}
    speech = {"utterance_start": 0.35, "utterance_end": 0.6, "pause": 0.5, "turn_end": 0.7}
    responses = {
        kind: {"probability": chance, "earliest_s": 0.0, "latest_s": 0.375} for kind, chance in speech.items()
    }
    movement = {
        "probability": 0.0,
        "earliest_s": 0.0,
        "latest_s": 0.05,
        "midpoint_deg": 17.0,
        "slope_deg": 4.6,
    }
    responses |= {"gaze_shift": movement, "head_turn": movement}
    responses["blink"] = {"probability": 1.0, "earliest_s": 0.0, "latest_s": 0.0}
    return {
        "intervals": laws,
        "drift": {"spread": drift, "kept": round(fit.kept, 3)},
        "slow_drift": {"spread": slow, "kept": fit.slow_kept},
        "responses": responses,
        "profile": profile_defaults(data),
        "least_interval_s": 0.22,
        "gaze_closure_per_deg": 0.016,
        "squint_closure": 0.35,
        "sources": SOURCES,
    }


def report(data: Path) -> None:
    """Print the fit, and how the half that was not fitted agrees."""
    for eye in ("left", "right"):
        intervals = intervals_of(data, eye)
        halves = np.split(intervals, [intervals.size // 2])
        for name, (fitted, kept) in {"first": halves, "second": halves[::-1]}.items():
            fit = with_slow_drift(fit_intervals(fitted), SLOW_KEPT, **HOUR)
            p = held_out_p(fit, fitted, kept)
            print(f"{eye} eye, {name} half: {_told(fit, fitted)}; the other half p {p:.3f}")
    _, residuals = fitted_shapes()
    print(f"courses: residual median {np.median(residuals):.3f}, greatest {residuals.max():.3f} of the way")


def _told(fit: IntervalFit, intervals_s: Array) -> str:
    others = {
        "no drift": fit_intervals(intervals_s, drifts=False),
        "log-normal": fit_intervals(intervals_s, "lognormal"),
    }
    gains = ", ".join(
        f"{fit.log_likelihood - other.log_likelihood:+.1f} to {name}" for name, other in others.items()
    )
    return (
        f"gamma of shape {fit.spread:.2f}, drift {fit.drift:.3f}, kept {fit.kept:.3f} "
        f"(log-likelihood {gains}), slow drift {fit.slow_spread:.3f}"
    )


def main() -> None:
    """Print how well the defaults fit; write them where asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--write", action="store_true")
    chosen = parser.parse_args()
    report(chosen.data)
    if chosen.write:
        DEFAULTS.write_text(json.dumps(defaults(chosen.data), indent=2) + "\n", encoding="utf-8")
        print(f"wrote {DEFAULTS.name}")


if __name__ == "__main__":
    main()
