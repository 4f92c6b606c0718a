"""A simulated observer with a true psychometric function, for studies that look for thresholds."""

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from statistics import NormalDist

from experiments.definition import Experiment
from experiments.errors import InputError, did_you_mean
from experiments.trials.threshold.declaration import threshold_of
from experiments.trials.threshold.grid import model, standard_of, stimuli


@dataclass(frozen=True)
class Truth:
    """The function P(x) = guess + (1 - guess - lapse) Phi((x - threshold) / spread), turned where it falls.

    Attributes
    ----------
    threshold, spread: mean and SD of the normal distribution, in the stimulus's unit. sd: spread of the
    thresholds of people around `threshold`. guess, lapse: the function's ends.
    """

    threshold: float
    spread: float
    sd: float = 0.0
    guess: float = 0.02
    lapse: float = 0.02

    def of_person(self, rng: random.Random) -> "Truth":
        """The function of one person."""
        return replace(self, threshold=self.threshold + rng.gauss(0, self.sd))

    def probability(self, stimulus: float, *, falling: bool = False) -> float:
        """How likely the answer is yes, or right."""
        z = (stimulus - self.threshold) / self.spread
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
    names, found = [field.name for field in fields(Truth)], {}
    for part in filter(None, text.split(",")):
        name, _, number = part.partition("=")
        if name.strip() not in names:
            near = did_you_mean(name.strip(), names)
            raise InputError(f"--observer: expected {', '.join(names)}, got '{name.strip()}'{near}")
        try:
            found[name.strip()] = float(number)
        except ValueError as error:
            raise InputError(f"--observer: expected a number for {name.strip()}, got '{number}'") from error
    return found


@dataclass(frozen=True)
class Observer:
    """Somebody who sees stimuli by their true function. numbers: of the stimulus in each clip, by hash."""

    truth: Truth
    numbers: Mapping[str, float]
    falling: bool

    def of_person(self, rng: random.Random) -> "Observer":
        """One person of those this stands for."""
        return replace(self, truth=self.truth.of_person(rng))

    def sees(self, clip: str) -> float:
        """How likely they say yes to a clip, or name it rightly; nothing is to be seen in the standard."""
        if clip not in self.numbers:
            return 0.0
        return self.truth.probability(self.numbers[clip], falling=self.falling)


def observer_of(experiment: Experiment, levels_of: Mapping[str, Mapping[str, str]], text: str) -> Observer:
    """The observers of a study of thresholds. levels_of: levels of each clip, by hash."""
    falling = threshold_of(experiment).direction == "falling"
    return Observer(truth_of(experiment, text), _numbers(experiment, levels_of), falling)


def _numbers(experiment: Experiment, levels_of: Mapping[str, Mapping[str, str]]) -> dict[str, float]:
    factor, standard = threshold_of(experiment).stimulus.factor, standard_of(threshold_of(experiment))
    number = {level: value for value, level in stimuli(experiment).items()}
    named: Iterable[tuple[str, str]] = ((clip, levels[factor]) for clip, levels in levels_of.items())
    return {clip: number[level] for clip, level in named if level != standard}
