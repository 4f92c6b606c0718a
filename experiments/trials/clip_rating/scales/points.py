"""Whole numbers side by side, the ends labelled or each of them."""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import model_validator

from experiments.base import IMPLIED, Translated
from experiments.trials.clip_rating.scales.scale import Scale


class Points(Scale):
    """The points of a rating scale: whole numbers from `minimum` to `maximum`, 2 to 11 of them.

    Either the two ends are labelled (`low`, `high`) or every point (`labels`).
    """

    type: Annotated[Literal["points"], IMPLIED] = "points"
    """Names this type of scale; it is meant where none is named."""
    minimum: int = 1
    """Lowest point of the scale, a whole number."""
    maximum: int = 7
    """Highest point; with the lowest it makes 2 to 11 points."""
    low: Translated | None = None
    """Label of the lowest point."""
    high: Translated | None = None
    """Label of the highest point."""
    labels: tuple[Translated, ...] = ()
    """Labels of all points from the lowest, instead of `low` and `high`."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        count = self.maximum - self.minimum + 1
        if not 2 <= count <= 11:
            raise ValueError(f"expected 2 to 11 scale points, got {self.minimum} to {self.maximum}")
        if self.labels and (self.low or self.high):
            raise ValueError("expected low and high, or labels of all points; got both")
        if self.labels and len(self.labels) != count:
            raise ValueError(f"expected {count} labels, one a point, got {len(self.labels)}")
        if not self.labels and not (self.low and self.high):
            raise ValueError("expected low and high, or labels of all points; got neither")
        return self

    @property
    def lowest(self) -> float:
        """The lowest point."""
        return self.minimum

    @property
    def highest(self) -> float:
        """The highest point."""
        return self.maximum

    @property
    def ends(self) -> tuple[Translated, Translated]:
        """The labels of the first and of the last point."""
        return (self.low or self.labels[0], self.high or self.labels[-1])

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """The labels too."""
        yield from super().texts()
        yield from (("labels", label) for label in self.labels)

    def said(self, language: str) -> str:
        """Every label where there are more than two."""
        points = (
            f"{self.minimum + step} {label.get(language, '')}" for step, label in enumerate(self.labels)
        )
        return super().said(language) + (f" Labels: {', '.join(points)}." if self.labels else "")
