"""A simulated observer with a true psychometric function, for studies that look for thresholds."""

import random
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from statistics import NormalDist

from experiments.definition import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.trials.threshold.grid import Point, model, points_of


@dataclass(frozen=True)
class Truth:
    """The function P(x) = guess + (1 - guess - lapse) Phi((x - threshold) / spread), turned where it falls.

    Attributes
    ----------
    threshold, spread : float
        Mean and SD of the normal distribution, in the stimulus's unit.
    sd : float
        Spread of the thresholds of people around `threshold`.
    guess, lapse : float
        The function's ends.
    tilt : float
        With a second factor, how far the threshold moves per unit of its numbers; `threshold` is that at
        their middle.
    """

    threshold: float
    spread: float
    sd: float = 0.0
    guess: float = 0.02
    lapse: float = 0.02
    tilt: float = 0.0

    def of_person(self, rng: random.Random) -> "Truth":
        """The function of one person."""
        return replace(self, threshold=self.threshold + rng.gauss(0, self.sd))

    def probability(self, stimulus: float, *, off_middle: float = 0.0, falling: bool = False) -> float:
        """How likely the answer is yes, or right.

        Parameters
        ----------
        off_middle : float, optional
            The second number, from the middle of all.
        """
        z = (stimulus - self.threshold - self.tilt * off_middle) / self.spread
        return self.guess + (1 - self.guess - self.lapse) * NormalDist().cdf(-z if falling else z)


def truth_of(experiment: Experiment, text: str = "") -> Truth:
    """The function that `text` sets (`threshold=200,spread=30,sd=10`), with usual values for the rest.

    Where not set, the threshold lies in the middle of the stimuli and the spread is an eighth of their range.
    """
    assumed = model(experiment)
    low, high = assumed.stimuli[0], assumed.stimuli[-1]
    usual = Truth((low + high) / 2, (high - low) / 8, 0.0, assumed.guess, assumed.lapse)
    truth = replace(usual, **_settings(text))
    if not truth.spread > 0 or not truth.sd >= 0 or not 0 <= truth.guess <= 1 - truth.lapse <= 1:
        raise InputError(
            f"--observer: expected spread above 0, sd from 0, guess and lapse within 0 to 1; got {text}"
        )
    return truth


def _settings(text: str) -> dict[str, float]:
    names, settings = [field.name for field in fields(Truth)], {}
    for part in filter(None, text.split(",")):
        name, _, number = part.partition("=")
        if name.strip() not in names:
            near = did_you_mean(name.strip(), names)
            raise InputError(f"--observer: expected {', '.join(names)}, got '{name.strip()}'{near}")
        try:
            settings[name.strip()] = float(number)
        except ValueError as error:
            raise InputError(f"--observer: expected a number for {name.strip()}, got '{number}'") from error
    return settings


@dataclass(frozen=True)
class Observer:
    """Somebody who sees stimuli by their true function.

    Attributes
    ----------
    points : mapping of str to Point
        The stimulus in each clip, by hash.
    middle : float
        Of the second factor's numbers.
    """

    truth: Truth
    points: Mapping[str, Point]
    falling: bool
    middle: float = 0.0

    def of_person(self, rng: random.Random) -> "Observer":
        """One person of those this stands for."""
        return replace(self, truth=self.truth.of_person(rng))

    def sees(self, clip: str) -> float:
        """How likely they say yes to a clip, or name it rightly; nothing is to be seen in the standard."""
        if clip not in self.points:
            return 0.0
        value, second = self.points[clip]
        off_middle = 0.0 if second is None else second - self.middle
        return self.truth.probability(value, off_middle=off_middle, falling=self.falling)


def observer_of(experiment: Experiment, levels_of: Mapping[str, Mapping[str, str]], text: str) -> Observer:
    """The observers of a study of thresholds.

    Parameters
    ----------
    levels_of : mapping of str to mapping of str to str
        Levels of each clip, by hash.
    """
    assumed = model(experiment)
    return Observer(
        truth_of(experiment, text), points_of(experiment, levels_of), assumed.falling, assumed.middle
    )
