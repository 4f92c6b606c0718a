"""The figures a synthetic data set must give: as printed, so that their digits say how exact they are."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from experiments.trials.scales import RatedScale

FOLDER = Path(__file__).parent

MarginLevels = dict[str, str]
"""Levels that name a margin or a cell, e.g. `{blur: MB, amplitude: FC}`; other factors are averaged over."""

Printed = Annotated[str, Field(pattern=r"^[<>]?\d+(\.\d+)?$")]


GRAND_SD, CONTRAST_SD = 0.75 / 6, 0.35 / 6
"""Spread of people's means and of their contrasts in Exp 1 to 3, as a part of the scale's width."""


class _Figures(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PrintedMean(_Figures):
    """A marginal or cell mean."""

    at: MarginLevels
    printed: Printed


class PrintedSpread(_Figures):
    """A standard error or standard deviation over participants of a marginal mean."""

    at: MarginLevels
    kind: Literal["se", "sd"]
    printed: Printed


class PrintedTest(_Figures):
    """F (multivariate, df q and N - q) and p of an effect; either may be missing."""

    effect: str
    f: Printed | None = None
    p: Printed | None = None


class PrintedPairs(_Figures):
    """All Bonferroni-corrected pairs of a factor are significant below a level, but for those named."""

    factor: str
    all_significant_below: float
    exceptions: tuple[tuple[str, str], ...] = Field(default=(), alias="except")


class Direction(_Figures):
    """An order of means: one pair of places, a factor's whole order, or the highest place."""

    higher: MarginLevels | None = None
    lower: MarginLevels | None = None
    order: dict[str, tuple[str, ...]] | None = None
    within: str | None = None
    highest: MarginLevels | None = None
    vary: str | None = None


class InventedMean(_Figures):
    """A mean nobody printed, needed to make whole data."""

    at: MarginLevels
    mean: float


class Published(_Figures):
    """Everything wanted of one experiment's synthetic data, and the invented rest."""

    experiment: str
    grand_mean: float
    grand_sd: float
    contrast_sd: float
    means: tuple[PrintedMean, ...] = ()
    spreads: tuple[PrintedSpread, ...] = ()
    tests: tuple[PrintedTest, ...] = ()
    pairs: tuple[PrintedPairs, ...] = ()
    directions: tuple[Direction, ...] = ()
    invented_means: tuple[InventedMean, ...] = ()
    slope_shares: dict[str, float] = {}
    gives_way: MarginLevels = {}
    assumed: bool = False
    """Nothing is published: an effect is as large as its F and the usual spread of contrasts make it."""


def load_published(name: str) -> Published:
    """The shipped figures of `exp1`, `exp2` or `exp3`."""
    return Published.model_validate(tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8")))


def assumed(name: str, scale: RatedScale) -> Published:
    """For a study that nobody has run: the middle of the scale, and people who differ as in Exp 1 to 3."""
    width = scale.maximum - scale.minimum
    return Published(
        experiment=name,
        grand_mean=scale.minimum + width / 2,
        grand_sd=GRAND_SD * width,
        contrast_sd=CONTRAST_SD * width,
        assumed=True,
    )


def decimals(printed: str) -> int:
    """Digits after the point of a printed figure."""
    return len(printed.partition(".")[2])


def window(printed: str) -> tuple[float, float]:
    """Values that print as this figure; open-ended for `<0.001` and `>0.05`."""
    if printed[0] in "<>":
        bound = float(printed[1:])
        return (0.0, bound) if printed[0] == "<" else (bound, float("inf"))
    half = 0.5 * 10.0 ** -decimals(printed)
    return float(printed) - half, float(printed) + half


def prints_as(value: float, printed: str) -> bool:
    """Whether `value` rounds to the printed figure, or lies beyond the bound of `<0.001`, `>0.05`."""
    if printed[0] in "<>":
        low, high = window(printed)
        return low < value < high
    return f"{value:.{decimals(printed)}f}" == f"{float(printed):.{decimals(printed)}f}"
