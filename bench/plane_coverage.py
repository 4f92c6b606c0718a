"""How often intervals of threshold and tilt hold the truth in adaptive studies of `plane-demo`.

    python -m bench.plane_coverage --sets 200 --people 8 --sd 30

People are simulated all at once: QUEST+ with the declared parameters chooses each stimulus by the least
expected entropy, as the server's library does, here as products of matrices. Every set is one study.
"""

import argparse

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from analysis.thresholds.likelihood import Interval
from analysis.thresholds.plane import Points, counted_points, fit_plane
from analysis.thresholds.plane_people import fit_plane_population
from bench.harness import say
from experiments.declaration.threshold import threshold_of
from experiments.errors import InputError
from experiments.kinds.threshold_grid import Model, model
from experiments.load import load_experiment

Array = NDArray[np.float64]
THRESHOLD, SPREAD, TILT = 280.0, 40.0, 200.0
LEAST = 1e-300


def answers(assumed: Model, sd: float, people: int, rng: np.random.Generator) -> tuple[list[Array], Array]:
    """(trials, 3) of each person: x, z and answer; and their posterior mean tilts (people,)."""
    stop = threshold_of(load_experiment("plane-demo")).stop
    assert stop.trials is not None
    assert stop.sd is not None
    x, z = (grid.ravel() for grid in np.meshgrid(assumed.stimuli, np.array(assumed.seconds) - assumed.middle))
    t, s, b = (
        grid.ravel()[:, None]
        for grid in np.meshgrid(assumed.thresholds, assumed.spreads, assumed.tilts, indexing="ij")
    )
    rise = 1 - assumed.guess - assumed.lapse
    yes = assumed.guess + rise * special.ndtr((x - t - b * z) / s)
    both = np.hstack([yes, 1 - yes])
    logs = both * np.log(both)
    own = THRESHOLD + sd * rng.normal(size=(people, 1))
    true = assumed.guess + rise * special.ndtr((x - own - TILT * z) / SPREAD)
    posterior, going = np.full((people, t.size), 1 / t.size), np.full(people, True)
    given: list[list[tuple[float, float, float]]] = [[] for _ in range(people)]
    for trial in range(1, stop.trials + 1):
        each = posterior @ both
        plain = posterior * np.log(np.maximum(posterior, LEAST))
        entropy = each * np.log(np.maximum(each, LEAST)) - plain @ both - posterior @ logs
        chosen = (entropy[:, : x.size] + entropy[:, x.size :]).argmin(axis=1)
        said = rng.random(people) < true[np.arange(people), chosen]
        for person in np.flatnonzero(going):
            at = chosen[person]
            given[person].append((x[at], z[at] + assumed.middle, float(said[person])))
        after = posterior * np.where(said[:, None], yes.T[chosen], 1 - yes.T[chosen])
        posterior = np.where(going[:, None], after / after.sum(axis=1, keepdims=True), posterior)
        mean = posterior @ t[:, 0]
        if trial >= stop.at_least:
            going &= np.sqrt(posterior @ t[:, 0] ** 2 - mean**2) > stop.sd
    return [np.array(one) for one in given], posterior @ b[:, 0]


def holds(interval: Interval, truth: float) -> bool:
    low = -np.inf if interval.low is None else interval.low
    high = np.inf if interval.high is None else interval.high
    return bool(low <= truth <= high)


def points(trials: Array) -> Points:
    return counted_points(*trials.T)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    asked.add_argument("--sets", type=int, default=200)
    asked.add_argument("--people", type=int, default=8)
    asked.add_argument("--sd", type=float, default=30.0, help="SD of people's thresholds, ms")
    asked.add_argument("--seed", type=int, default=21)
    given = asked.parse_args()
    assumed, people = model(load_experiment("plane-demo")), given.people
    everybody, tilts = answers(assumed, given.sd, given.sets * people, np.random.default_rng(given.seed))
    rows: dict[str, list[tuple[float, bool]]] = {}
    for number in range(given.sets):
        mine = everybody[number * people : (number + 1) * people]
        try:
            pooled = fit_plane(
                points(np.vstack(mine)), middle=assumed.middle, guess=0.02, lapse=0.02, along=False
            )
        except InputError:
            continue
        all_people = fit_plane_population([points(one) for one in mine], pooled)
        own = tilts[number * people : (number + 1) * people]
        half = stats.t.ppf(0.975, people - 1) * own.std(ddof=1) / np.sqrt(people)
        shown = Interval(own.mean() - half, own.mean() + half)
        for name, estimate, interval, truth in (
            ("threshold, all trials", pooled.threshold, pooled.threshold_ci, THRESHOLD),
            ("threshold, people", all_people.threshold, all_people.threshold_ci, THRESHOLD),
            ("tilt, all trials", pooled.tilt, pooled.tilt_ci, TILT),
            ("tilt, people", all_people.tilt, all_people.tilt_ci, TILT),
            ("tilt, Results", float(own.mean()), shown, TILT),
        ):
            rows.setdefault(name, []).append((estimate, holds(interval, truth)))
    say(f"{people} people a set, SD {given.sd:g}, {np.mean([len(one) for one in everybody]):.1f} trials each")
    for name, row in rows.items():
        estimates, held = (np.array(column) for column in zip(*row, strict=True))
        error = estimates.std(ddof=1) / np.sqrt(estimates.size)
        say(f"{name:24s} mean {estimates.mean():7.1f} +- {error:.1f}, interval held {held.mean():.3f}")


if __name__ == "__main__":
    main()
