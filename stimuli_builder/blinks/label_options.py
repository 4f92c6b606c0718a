"""The values of the labelling rule and their named sets."""

from dataclasses import dataclass
from types import MappingProxyType

from experiments.errors import InputError, did_you_mean


@dataclass(frozen=True)
class LabelOptions:
    """Values of the labelling rule; all frame counts are at 300 fps, as the paper's, and scale with the rate.

    Exactly one of the three gradient limits is given.

    Parameters
    ----------
    filter_frames : float
        Width of the zero-phase filter.
    gradient_frames : float
        Window over which the gradient is averaged.
    gradient_peak : float or None
        Largest averaged gradient at onset and end, as part of the greatest one of the same phase.
    gradient_opening : float or None
        The same as part of the eye's opening per 300 fps frame.
    gradient_px : float or None
        The same in pixels per 300 fps frame (the paper's 0.1).
    opening_px : float
        Opening of the eye in pixels that `gradient_px` supposes where the series is not in pixels.
    baseline_frames : float
        The baseline is the mean over so many frames on either side of the minimum.
    search_frames : float
        How far from the minimum the onset and the end are looked for.
    minimum_depth : float
        Least depth of a blink as part of the eye's opening; smaller dips are twitches and noise.
    minimum_tolerance : float
        Frames this close to the lowest one, as part of the amplitude, may be the minimum; 0: only the lowest.
    """

    filter_frames: float = 10
    gradient_frames: float = 20
    gradient_peak: float | None = 0.035
    gradient_opening: float | None = None
    gradient_px: float | None = None
    opening_px: float = 60.0
    baseline_frames: float = 100
    search_frames: float = 300
    minimum_depth: float = 0.23
    minimum_tolerance: float = 0.01

    def __post_init__(self) -> None:
        if [self.gradient_peak, self.gradient_opening, self.gradient_px].count(None) != 2:
            raise InputError(
                "give one gradient limit: as part of the peak, of the opening, or in pixels a frame"
            )
        for name, value in vars(self).items():
            least = "0 or more" if name == "minimum_tolerance" else "greater than 0"
            if value is not None and not (value > 0 or (value == 0 and least == "0 or more")):
                raise InputError(f"{name.replace('_', '-')} must be {least}, got {value:g}")
        for name in ("gradient_peak", "minimum_depth", "minimum_tolerance"):
            value = getattr(self, name)
            if value is not None and value >= 1:
                raise InputError(f"{name.replace('_', '-')} is a part of the whole, below 1, got {value:g}")


DEFAULT_OPTIONS = LabelOptions()
PRESETS = MappingProxyType(
    {
        "velocity": DEFAULT_OPTIONS,
        "relative": LabelOptions(
            gradient_frames=10, gradient_peak=None, gradient_opening=0.001, minimum_tolerance=0
        ),
        "paper": LabelOptions(gradient_frames=10, gradient_peak=None, gradient_px=0.1, minimum_tolerance=0),
    }
)


def preset(name: str) -> LabelOptions:
    """Return the named set of values: "velocity", "relative" or "paper" (0.1 px a frame)."""
    if name not in PRESETS:
        raise InputError(f"unknown preset '{name}'{did_you_mean(name, [*PRESETS, 'classifier'])}")
    return PRESETS[name]
