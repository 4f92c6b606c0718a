"""QUEST+ (Watson 2017, Journal of Vision 17(3):10) by the library questplus: the one module that uses it.

It is loaded with the first series that is followed, since it brings numpy, scipy and pandas with it; servers
without such studies never load it (decision 0505). Equal answers give equal estimates and choices.
"""

import math
import threading
import warnings
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from experiments.kinds.threshold_grid import Model, Point

if TYPE_CHECKING:
    from questplus import QuestPlus

YES, NO = "yes", "no"
MAX_STATES, MAX_PARAMETERS = 4096, 4_000_000
"""Posteriors kept, and parameters in all of them: participants of one study share the first ones, and each
answer needs that before it."""

Answers = tuple[tuple[Point, bool], ...]
"""Stimulus and whether the answer was yes (or right), in the order of answering."""


class Estimate(NamedTuple):
    """What is known after some answers: means over the posterior, its SD, and its entropy in bits.

    With a second factor the threshold is that at the middle of its numbers.
    """

    threshold: float
    threshold_sd: float
    spread: float
    entropy: float


@dataclass(frozen=True)
class _State:
    posterior: Any
    chosen: Point
    yes_is_likelier: bool
    estimate: Estimate


_states: "OrderedDict[tuple[Model, Answers], _State]" = OrderedDict()
_working = threading.Lock()


def estimate(model: Model, answers: Answers) -> Estimate:
    """The estimate after these answers."""
    with _working:
        return _state_after(model, answers).estimate


def choices(model: Model, answers: Answers, count: int) -> list[Point]:
    """The stimuli of the next `count` trials.

    The first is the one that leaves the least expected entropy. Those after it are chosen as if each one
    before had got the answer that is likelier by the posterior.
    """
    chosen: list[Point] = []
    with _working:
        for _ in range(count):
            state = _state_after(model, answers)
            chosen.append(state.chosen)
            answers = (*answers, (state.chosen, state.yes_is_likelier))
    return chosen


class Tilt(NamedTuple):
    """Mean and SD of the posterior of a tilt, in units of the stimulus a unit of the second factor."""

    mean: float
    sd: float


def tilt(model: Model, counts: Mapping[Point, tuple[int, int]]) -> Tilt:
    """What a person's answers say of the tilt: number of answers and of positive ones at each stimulus.

    The posterior does not depend on the order of answers, so that counts are enough.
    """
    with _working:
        engine, table = _engine(model), _likelihoods(model)
        posterior = engine.prior.values
        for point, (n, positive) in counts.items():
            yes, no = table[point]
            posterior = posterior * yes**positive * no ** (n - positive)
            # After each stimulus, as the product of hundreds of likelihoods is zero in double precision.
            posterior = posterior / posterior.sum()
        axis = list(engine.param_domain).index("tilt")
        others = tuple(other for other in range(posterior.ndim) if other != axis)
        shares, values = posterior.sum(axis=others).tolist(), engine.param_domain["tilt"].tolist()
    # Summed exactly: the estimate must not depend on how an array is split for its sum.
    mean = math.fsum(p * value for p, value in zip(shares, values, strict=True))
    variance = math.fsum(p * (value - mean) ** 2 for p, value in zip(shares, values, strict=True))
    return Tilt(-mean if model.falling else mean, math.sqrt(variance))


@lru_cache(maxsize=64)
def _likelihoods(model: Model) -> dict[Point, tuple[Any, Any]]:
    """Likelihoods of both answers at every stimulus, over the parameters in the order of the prior."""
    engine = _engine(model)
    return {
        point: tuple(
            engine.likelihoods.sel(**_named_stimulus(model, point), response=said)
            .transpose(*engine.prior.dims)
            .values
            for said in (YES, NO)
        )
        for point in (Point(value, second) for value in model.stimuli for second in model.seconds)
    }


def _state_after(model: Model, answers: Answers) -> _State:
    """The state after these answers, from the longest beginning of them that is kept."""
    begin = len(answers)
    # The longest kept beginning: a further answer costs one update, whichever worker took those before.
    while begin and (model, answers[:begin]) not in _states:
        begin -= 1
    state = _states.get((model, answers[:begin])) or _store_state(model, (), None)
    # What was used last goes last, and is forgotten last.
    _states.move_to_end((model, answers[:begin]))
    for end in range(begin + 1, len(answers) + 1):
        state = _store_state(model, answers[:end], state)
    return state


def _store_state(model: Model, answers: Answers, before: _State | None) -> _State:
    with warnings.catch_warnings():
        # Where a parameter has become impossible, the library takes the logarithm of 0 and leaves it out.
        warnings.simplefilter("ignore")
        state = _next_state(model, answers, before)
    _states[model, answers] = state
    # By size and by number: a fine grid may hold a million parameters in one posterior.
    while len(_states) > min(MAX_STATES, max(1, MAX_PARAMETERS // state.posterior.size)):
        _states.popitem(last=False)
    return state


def _next_state(model: Model, answers: Answers, before: _State | None) -> _State:
    engine = _engine(model)
    if before is None:
        # The library's object is shared by all participants of a study: its posterior is set before each use.
        engine.posterior = engine.prior
    else:
        (stimulus, positive), engine.posterior = answers[-1], before.posterior
        engine.update(stim=_named_stimulus(model, stimulus), outcome={"response": YES if positive else NO})
        # It would grow with every answer of every participant that shares the object.
        engine.stim_history.clear()
        engine.resp_history.clear()
    spoken = engine.next_stim
    likelihood = engine.likelihoods.sel(**spoken, response=YES)
    share = float((engine.posterior * likelihood).sum())
    sign = -1 if model.falling else 1
    # A falling function is fitted with the stimulus turned round; here it is turned back.
    chosen = Point(sign * spoken["intensity"], spoken.get("second"))
    return _State(engine.posterior, chosen, share >= 0.5, _estimate(model, engine))


def _estimate(model: Model, engine: "QuestPlus") -> Estimate:
    threshold, spread = _names(model)
    means = engine.param_estimate
    values = engine.param_domain[threshold].tolist()
    shares = engine.marginal_posterior[threshold].tolist()
    variance = math.fsum(p * (v - means[threshold]) ** 2 for p, v in zip(shares, values, strict=True))
    every = engine.posterior.values.ravel().tolist()
    # p log p is 0 at p = 0, where the logarithm is not finite.
    entropy = -math.fsum(p * math.log2(p) for p in every if p > 0)
    sign = -1 if model.falling else 1
    return Estimate(sign * means[threshold], math.sqrt(variance), means[spread], max(0.0, entropy))


def _named_stimulus(model: Model, stimulus: Point) -> dict[str, float]:
    spoken = {"intensity": -stimulus.value if model.falling else stimulus.value}
    return spoken if stimulus.second is None else {**spoken, "second": stimulus.second}


def _names(model: Model) -> tuple[str, str]:
    return ("mean", "sd") if model.function == "normal" else ("threshold", "slope")


@lru_cache(maxsize=64)
def _engine(model: Model) -> "QuestPlus":
    """The library's object for a function; its likelihoods are made once, its posterior is set each time."""
    from questplus import QuestPlus

    if model.seconds:
        return _plane_engine(model)
    # The library's functions rise: where the declared one falls, the sign of the stimulus is turned.
    sign = -1 if model.falling else 1
    threshold, spread = _names(model)
    return QuestPlus(
        stim_domain={"intensity": sorted(sign * number for number in model.stimuli)},
        param_domain={
            threshold: sorted(sign * number for number in model.thresholds),
            spread: list(model.spreads),
            "lower_asymptote": [model.guess],
            "lapse_rate": [model.lapse],
        },
        outcome_domain={"response": [YES, NO]},
        func="norm_cdf" if model.function == "normal" else "weibull",
        stim_scale="linear",
    )


# Two stimulus variables: a threshold that is a straight line over the second.


@cache
def _plane_class() -> "type[QuestPlus]":
    """QuestPlus whose stimuli have a `second` variable and whose parameters have a `tilt`.

    Eq. (1) is the likelihood, with x the stimulus's number along the factor, z that along the second, z_0 the
    middle of z, t the threshold there, b the tilt and s the spread:

        P(x, z) = guess + (1 - guess - lapse) Phi((x - t - b (z - z_0)) / s)    (1)

    For each z and b it is the library's own function of the one variable x - b (z - z_0); Watson's contrast
    sensitivity function has its threshold linear in the second variable in the same way (2017, JOV 17(3):10).
    """
    import xarray
    from questplus import QuestPlus
    from questplus.psychometric_function import norm_cdf

    class PlaneQuest(QuestPlus):  # type: ignore[misc]
        def __init__(self, middle: float, **domains: Any) -> None:
            self.middle = middle
            super().__init__(func="norm_cdf", stim_scale="linear", **domains)

        def _gen_likelihoods(self) -> Any:
            """Eq. (1) for every stimulus and parameter, for both answers."""
            one = {name: values for name, values in self.param_domain.items() if name != "tilt"}
            along, tilts = self.stim_domain["intensity"], self.param_domain["tilt"]
            across = self.stim_domain["second"]

            def of_second(second: float) -> Any:
                shares = (
                    norm_cdf(intensity=along - tilt * (second - self.middle), **one).assign_coords(
                        intensity=along
                    )
                    for tilt in tilts
                )
                return xarray.concat(list(shares), dim=xarray.Variable("tilt", tilts))

            shares = xarray.concat(
                [of_second(second) for second in across], dim=xarray.Variable("second", across)
            )
            (answers,) = self.outcome_domain.values()
            return xarray.concat([shares, 1 - shares], dim=xarray.Variable("response", answers))

    return PlaneQuest


def _plane_engine(model: Model) -> "QuestPlus":
    """The library's object for a function of two variables; where it falls, x, threshold and tilt turn."""
    sign = -1 if model.falling else 1
    return _plane_class()(
        model.middle,
        stim_domain={
            "intensity": sorted(sign * number for number in model.stimuli),
            "second": list(model.seconds),
        },
        param_domain={
            "mean": sorted(sign * number for number in model.thresholds),
            "sd": list(model.spreads),
            "tilt": sorted(sign * number for number in model.tilts),
            "lower_asymptote": [model.guess],
            "lapse_rate": [model.lapse],
        },
        outcome_domain={"response": [YES, NO]},
    )
