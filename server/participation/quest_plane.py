"""QUEST+ over two stimulus variables: questplus with a threshold that is a straight line over the second.

Eq. (1) is the likelihood, with x the stimulus's number along the factor, z that along the second, z_0 the
middle of z, t the threshold there, b the tilt and s the spread:

    P(x, z) = guess + (1 - guess - lapse) Phi((x - t - b (z - z_0)) / s)    (1)

For each z and b it is the library's own function of the one variable x - b (z - z_0); Watson's contrast
sensitivity function has its threshold linear in the second variable in the same way (2017, JOV 17(3):10).
It is loaded with the first series that needs it, as `quest` loads the library.
"""

from typing import Any

import xarray
from questplus import QuestPlus
from questplus.psychometric_function import norm_cdf

from experiments.kinds.threshold_grid import Model


class PlaneQuest(QuestPlus):  # type: ignore[misc]
    """QuestPlus whose stimuli have a `second` variable and whose parameters have a `tilt`."""

    def __init__(self, middle: float, **domains: Any) -> None:
        self.middle = middle
        super().__init__(func="norm_cdf", stim_scale="linear", **domains)

    def _gen_likelihoods(self) -> Any:
        """Eq. (1) for every stimulus and parameter, for both answers."""
        one = {name: values for name, values in self.param_domain.items() if name != "tilt"}
        along, tilts = self.stim_domain["intensity"], self.param_domain["tilt"]
        across = self.stim_domain["second"]
        shares = xarray.concat(
            [
                xarray.concat(
                    [
                        norm_cdf(intensity=along - tilt * (second - self.middle), **one).assign_coords(
                            intensity=along
                        )
                        for tilt in tilts
                    ],
                    dim=xarray.Variable("tilt", tilts),
                )
                for second in across
            ],
            dim=xarray.Variable("second", across),
        )
        (answers,) = self.outcome_domain.values()
        return xarray.concat([shares, 1 - shares], dim=xarray.Variable("response", answers))


def engine(model: Model, yes: str, no: str) -> PlaneQuest:
    """The library's object for a function of two variables; where it falls, x, threshold and tilt turn."""
    sign = -1 if model.falling else 1
    return PlaneQuest(
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
        outcome_domain={"response": [yes, no]},
    )
