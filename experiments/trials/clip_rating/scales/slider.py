"""A line between two labels, without a handle before it is first touched."""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.base import Translated
from experiments.trials.clip_rating.scales.scale import Scale

MAX_STEPS = 10_000

Finite = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class Slider(Scale):
    """A slider from `minimum` to `maximum`. It has no handle, hence no answer, before it is first touched."""

    type: Literal["slider"] = "slider"
    """Names this type of scale."""
    minimum: Finite = 0.0
    """The number at its left end (right, where a language is read so)."""
    maximum: Finite = 100.0
    """The number at its other end."""
    step: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    """Difference of neighbouring answers; the range is a whole number of steps."""
    low: Translated
    """Label of the low end."""
    high: Translated
    """Label of the high end."""
    show_value: bool = False
    """Whether the number is shown while the slider is moved."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        steps = (self.maximum - self.minimum) / self.step
        if not 1 <= round(steps) <= MAX_STEPS or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"expected a range of 1 to {MAX_STEPS} whole steps, got {self.minimum:g} to {self.maximum:g} "
                f"in steps of {self.step:g}"
            )
        return self

    @property
    def lowest(self) -> float:
        """The number at the low end."""
        return self.minimum

    @property
    def highest(self) -> float:
        """The number at the high end."""
        return self.maximum

    @property
    def interval(self) -> float:
        """The declared step."""
        return self.step

    @property
    def ends(self) -> tuple[Translated, Translated]:
        """The two labels."""
        return (self.low, self.high)

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """The labels too."""
        yield from super().texts()
        yield from (("low", self.low), ("high", self.high))
