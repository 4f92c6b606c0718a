"""The scales that a trial of any kind asks for, as Results, reports and the analysis read them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiments.base import Translated
from experiments.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from experiments.definition import Experiment


@dataclass(frozen=True)
class RatedScale:
    """A scale on which every trial is rated.

    Attributes
    ----------
    name : str
        As the column `scale` of the view has it.
    type : str
        As declared: `points`, `slider`.
    minimum, maximum : float
        Ends of the range, which answers may take.
    step : float
        Between the answers that there are.
    reverse : bool
        Whether a high answer means little of what is measured; stored answers are as they were chosen.
    not_applicable : bool
        Whether "cannot say" is an answer too; it is stored without a number.
    question, low, high : Translated
        What is asked, and the labels of the ends, by language.
    member : str
        Path of the number in the stored answer (`trial_ratings.payload`), parts joined by dots.
    """

    name: str
    type: str
    minimum: float
    maximum: float
    step: float
    reverse: bool
    not_applicable: bool
    question: Translated
    low: Translated
    high: Translated
    member: str

    def admits(self, value: float) -> bool:
        """True where `value` is an answer of this scale: in its range and on a step."""
        steps = (value - self.minimum) / self.step
        return self.minimum <= value <= self.maximum and abs(steps - round(steps)) < 1e-6

    def nearest(self, value: float) -> float:
        """The answer of this scale that is nearest to `value`, a whole number as one."""
        clipped = min(self.maximum, max(self.minimum, value))
        answer = self.minimum + round((clipped - self.minimum) / self.step) * self.step
        return int(answer) if float(answer).is_integer() else round(answer, 6)


def scales_of(experiment: "Experiment") -> tuple[RatedScale, ...]:
    """The scales of the experiment's trials in order; none for kinds that are not rated on scales."""
    return experiment.trial.rated_scales()


def scale_called(experiment: "Experiment", name: str | None = None) -> RatedScale:
    """The scale of this name, the first where none is given; InputError where there is none."""
    scales = scales_of(experiment)
    if not scales:
        raise InputError(
            f"this needs trials with a scale, '{experiment.name}' has trials of the kind "
            f"{experiment.trial.kind}"
        )
    names = [scale.name for scale in scales]
    if name is not None and name not in names:
        raise InputError(f"'{experiment.name}' has no scale '{name}'{did_you_mean(name, names)}")
    return scales[names.index(name) if name is not None else 0]
