"""How far continuous ratings lag behind events, and how strongly they answer them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]
RESAMPLES, SHIFTS = 1000, 999


@dataclass(frozen=True, eq=False)
class ClipTraces:
    """The traces of one clip.

    Attributes
    ----------
    clip, cell : str
    rate_hz : float
        Samples a second.
    events_s : tuple of float
        When its events are, in s from the first sample.
    people : tuple of str
        Whose trace each row is.
    values : float64 array (people, samples)
    """

    clip: str
    cell: str
    rate_hz: float
    events_s: tuple[float, ...]
    people: tuple[str, ...]
    values: Array


@dataclass(frozen=True, eq=False)
class LagResult:
    """Correlation of the ratings' change with events, by lag.

    Attributes
    ----------
    lags_s : float64 array (n,)
    mean, ci_low, ci_high : float64 array (n,)
        Over people, with 95% t intervals.
    lag_s : float
        Where `mean` is greatest; `lag_low_s` and `lag_high_s` are the 2.5 and 97.5 percentiles of that place
        when people are drawn again with replacement.
    r, p : float
        `mean` there, and its probability where events fall anywhere: by random circular shifts of each clip's
        events, the greatest over lags against the greatest.
    """

    lags_s: Array
    mean: Array
    ci_low: Array
    ci_high: Array
    lag_s: float
    lag_low_s: float
    lag_high_s: float
    r: float
    p: float
    people: int


def event_train(events_s: Sequence[float], samples: int, rate_hz: float) -> Array:
    """(samples,) number of events in each sample's interval; an event belongs to the sample at its end."""
    train = np.zeros(samples)
    for time_s in events_s:
        # Up to the sample at the interval's end, but not over it for a rounding error.
        sample = int(np.ceil(time_s * rate_hz - 1e-9))
        if sample < samples:
            train[sample] += 1.0
    return train


def correlogram(values: Array, train: Array) -> Array:
    """(people, samples) circular cross-correlation of change and events, r(l) = mean_t z_d(t + l) z_e(t).

    d(t) = v(t) - v(t - 1), d(0) = 0; z is standardized over the clip. A constant trace has r = 0.
    """
    # Changes, not levels: slow drifts of a slider correlate with anything.
    change = np.diff(values, axis=1, prepend=values[:, :1])
    # Circular, by the Fourier transform: every lag at once, and the null distribution by shifts is exact
    # for it.
    spectrum = np.conj(np.fft.rfft(_standard(train[None, :])))
    together = np.fft.irfft(np.fft.rfft(_standard(change)) * spectrum, n=train.size, axis=1)
    return np.asarray(together / train.size, np.float64)


def _standard(rows: Array) -> Array:
    spread = rows.std(axis=1, keepdims=True)
    centred = rows - rows.mean(axis=1, keepdims=True)
    divided = np.divide(centred, spread, out=np.zeros_like(centred), where=spread > 1e-12)
    return np.asarray(divided, np.float64)


def lag_of(clips: Sequence[ClipTraces], max_lag_s: float, seed: int = 0) -> LagResult | None:
    """Find the lag at which ratings change most after events; None without events or with one person.

    Each person's correlations are averaged over their clips that have events, then over people.
    """
    eventful = [clip for clip in clips if clip.events_s and clip.values.shape[1] > 2]
    people = sorted({person for clip in eventful for person in clip.people})
    if len(people) < 2:
        return None
    rate = eventful[0].rate_hz
    # One more, since a lag of 0 counts as well.
    lags = int(min(max_lag_s * rate, min(clip.values.shape[1] for clip in eventful) - 1)) + 1
    row_of = {person: index for index, person in enumerate(people)}
    sums, counts = np.zeros((len(people), lags)), np.zeros(len(people))
    for clip in eventful:
        train = event_train(clip.events_s, clip.values.shape[1], clip.rate_hz)
        rows = [row_of[person] for person in clip.people]
        # Unlike `+=`, which would add once where a person comes twice.
        np.add.at(sums, rows, correlogram(clip.values, train)[:, :lags])
        np.add.at(counts, rows, 1)
    each: Array = sums / counts[:, None]
    mean = each.mean(axis=0)
    half = stats.t.ppf(0.975, len(people) - 1) * each.std(axis=0, ddof=1) / np.sqrt(len(people))
    rng = np.random.default_rng(seed)
    drawn = each[rng.integers(len(people), size=(RESAMPLES, len(people)))].mean(axis=1).argmax(axis=1)
    low, high = np.percentile(drawn, (2.5, 97.5)) / rate
    best = int(mean.argmax())
    return LagResult(
        np.arange(lags) / rate,
        mean,
        mean - half,
        mean + half,
        best / rate,
        float(low),
        float(high),
        float(mean[best]),
        _chance(eventful, lags, rng),
        len(people),
    )


def _chance(clips: Sequence[ClipTraces], lags: int, rng: np.random.Generator) -> float:
    """How often shifted events correlate as much at their best lag: (1 + times) / (1 + SHIFTS)."""
    means, weights = [], []
    for clip in clips:
        train = event_train(clip.events_s, clip.values.shape[1], clip.rate_hz)
        means.append(correlogram(clip.values, train).mean(axis=0))
        weights.append(len(clip.people))

    def greatest(shifts: Sequence[int]) -> float:
        # Shifted events only turn the correlogram, which need not be computed again.
        rows = [np.roll(row, -shift)[:lags] for row, shift in zip(means, shifts, strict=True)]
        return float(np.average(rows, axis=0, weights=weights).max())

    seen = greatest([0] * len(means))
    # The greatest over lags against the greatest: the p needs no further correction for the many lags.
    times = sum(
        greatest([int(rng.integers(row.size)) for row in means]) >= seen - 1e-12 for _ in range(SHIFTS)
    )
    # The observed one counts among the shifts, so that p is never 0 (Phipson & Smyth 2010).
    return (1 + times) / (1 + SHIFTS)


@dataclass(frozen=True, eq=False)
class MeanTrace:
    """The mean trace of a cell over people, each person's clips averaged first; 95% t intervals.

    `events_s` has a tuple for each clip of the cell: when its events are.
    """

    cell: str
    times_s: Array
    mean: Array
    ci_low: Array
    ci_high: Array
    level: float
    level_low: float
    level_high: float
    people: int
    events_s: tuple[tuple[float, ...], ...] = ()


def mean_trace(clips: Sequence[ClipTraces]) -> MeanTrace:
    """The mean trace of one cell's clips, as long as the shortest of them."""
    samples = min(clip.values.shape[1] for clip in clips)
    # A person's clips first, then people: a person with more ratings must not weigh more.
    of_person: dict[str, list[Array]] = {}
    for clip in clips:
        for person, row in zip(clip.people, clip.values, strict=True):
            of_person.setdefault(person, []).append(row[:samples])
    rows = np.array([np.mean(traces, axis=0) for traces in of_person.values()])
    mean, low, high = _interval(rows)
    level, level_low, level_high = (float(one[0]) for one in _interval(rows.mean(axis=1, keepdims=True)))
    return MeanTrace(
        clips[0].cell,
        np.arange(samples) / clips[0].rate_hz,
        mean,
        low,
        high,
        level,
        level_low,
        level_high,
        len(rows),
        tuple(clip.events_s for clip in clips),
    )


def _interval(rows: Array) -> tuple[Array, Array, Array]:
    mean = rows.mean(axis=0)
    if len(rows) < 2:
        return mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    half = stats.t.ppf(0.975, len(rows) - 1) * rows.std(axis=0, ddof=1) / np.sqrt(len(rows))
    return mean, mean - half, mean + half
