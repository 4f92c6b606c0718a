"""The figures a synthetic data set must give: as printed, so that their digits say how exact they are."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from analysis.within.strata import effect_members, effect_name, orthonormal_basis
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import RatedScale
from experiments.design import rated_levels
from experiments.errors import InputError, did_you_mean
from experiments.kinds import scales_of

FOLDER = Path(__file__).parent

MarginLevels = dict[str, str]
"""Levels that name a margin or a cell, e.g. `{blur: MB, amplitude: FC}`; other factors are averaged over."""

# Text, since 4.80 and 4.8 are known to different precision.
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


class PublishedFigures(_Figures):
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


def load_published(name: str) -> PublishedFigures:
    """The shipped figures of `exp1`, `exp2` or `exp3`."""
    return PublishedFigures.model_validate(
        tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    )


def assumed(name: str, scale: RatedScale) -> PublishedFigures:
    """For a study that nobody has run: the middle of the scale, and people who differ as in Exp 1 to 3."""
    width = scale.maximum - scale.minimum
    return PublishedFigures(
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
        # A printed p is positive, so below a bound it begins at 0.
        bound = float(printed[1:])
        return (0.0, bound) if printed[0] == "<" else (bound, float("inf"))
    # Half of the last printed digit.
    half = 0.5 * 10.0 ** -decimals(printed)
    return float(printed) - half, float(printed) + half


def prints_as(value: float, printed: str) -> bool:
    """Whether `value` rounds to the printed figure, or lies beyond the bound of `<0.001`, `>0.05`."""
    if printed[0] in "<>":
        low, high = window(printed)
        # A bound itself is not below or above itself.
        return low < value < high
    # As texts, since decimals such as 4.85 are not exact in binary.
    return f"{value:.{decimals(printed)}f}" == f"{float(printed):.{decimals(printed)}f}"


# The design as matrices: which cells a place covers, which contrasts an effect has.

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DesignSpace:
    """Cells of a factorial design, last factor fastest."""

    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, experiment: Experiment) -> "DesignSpace":
        """Factors in the order of the experiment's analysis plan, with the levels that are rated."""
        order = experiment.analysis.factors or experiment.factor_names
        return cls(tuple(order), tuple(tuple(rated_levels(experiment, f)) for f in order))

    @property
    def shape(self) -> tuple[int, ...]:
        """Levels of each factor."""
        return tuple(len(names) for names in self.levels)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape))

    @cached_property
    def effects(self) -> dict[str, Floats]:
        """Orthonormal contrasts (cells, q) of every effect, main effects first."""
        return {
            effect_name([self.factors[m] for m in members]): self._contrasts(members)
            for members in effect_members(len(self.factors))
        }

    def _contrasts(self, members: Sequence[int]) -> Floats:
        block = np.ones((1, 1))
        for axis, size in enumerate(self.shape):
            basis = orthonormal_basis(size)
            # The first column of a basis is constant: factors outside an effect are averaged.
            block = np.asarray(np.kron(block, basis[:, 1:] if axis in members else basis[:, :1]))
        return block

    def weights(self, at: Mapping[str, str]) -> Floats:
        """Averaging weights (cells,) of a margin or cell; InputError for an unknown factor or level."""
        weight: Floats = np.ones(1)
        for factor, level in at.items():
            self._check(factor, level)
        for factor, names in zip(self.factors, self.levels, strict=True):
            # A factor that is not named is averaged over its levels.
            chosen = [at[factor]] if factor in at else list(names)
            weight = np.asarray(np.kron(weight, np.array([name in chosen for name in names]) / len(chosen)))
        return weight

    def _check(self, factor: str, level: str) -> None:
        if factor not in self.factors:
            raise InputError(f"no factor '{factor}'{did_you_mean(factor, self.factors)}")
        names = self.levels[self.factors.index(factor)]
        if level not in names:
            raise InputError(f"'{level}' is not a level of '{factor}'{did_you_mean(level, names)}")

    def levels_of(self, factor: str) -> tuple[str, ...]:
        """Level names of a factor."""
        if factor not in self.factors:
            raise InputError(f"no factor '{factor}'{did_you_mean(factor, self.factors)}")
        return self.levels[self.factors.index(factor)]

    def effect_called(self, name: str) -> str:
        """The effect whose factors are those of `name`, in the design's own order."""
        factors = name.split(":")
        # blur:amplitude and amplitude:blur are one effect.
        for effect in self.effects:
            if sorted(effect.split(":")) == sorted(factors):
                return effect
        raise InputError(f"no effect '{name}'{did_you_mean(name, self.effects)}")


# What a user wants otherwise: other means, other effect sizes.


def with_wishes(
    published: PublishedFigures, space: DesignSpace, means: Sequence[str], effects: Sequence[str]
) -> PublishedFigures:
    """Replace published figures by wishes.

    Figures that would contradict a wish (the order and the pairs of its factors, a mean at the same place,
    the printed p of the same effect, the means of an effect wished away) are dropped; all others stay.

    Parameters
    ----------
    means : sequence of str
        `factor.level=4.80` (several levels joined by commas: `blur.MB,amplitude.FC=4.9`).
    effects : sequence of str
        `blur:amplitude=20.35`, the multivariate F wanted; `=0` for no effect.
    """
    wished_means = [_mean(text, space) for text in means]
    wished_tests = [_test(text, space) for text in effects]
    # By factors: a wish about a factor makes printed orders and pairs of that factor doubtful.
    touched = [frozenset(m.at) for m in wished_means] + [frozenset(t.effect.split(":")) for t in wished_tests]
    if not touched:
        return published
    places = [m.at for m in wished_means]
    named = {t.effect for t in wished_tests}
    # F = 0 wants equal means, which printed means of that effect contradict.
    gone = [frozenset(t.effect.split(":")) for t in wished_tests if float(t.f or 1) == 0]
    update = {
        "means": (*_kept(published.means, places, gone), *wished_means),
        "tests": (
            *(t for t in published.tests if space.effect_called(t.effect) not in named),
            *wished_tests,
        ),
        "pairs": tuple(p for p in published.pairs if not any(p.factor in t for t in touched)),
        "directions": tuple(d for d in published.directions if not any(t & _factors(d) for t in touched)),
        "invented_means": tuple(
            m
            for m in published.invented_means
            # An invented mean gives way to wishes about its factors, alone or with others.
            if not any(set(m.at) <= set(p) for p in places) and not any(g <= set(m.at) for g in gone)
        ),
    }
    return published.model_copy(update=update)


def _kept(
    means: tuple[PrintedMean, ...], places: list[MarginLevels], gone: list[frozenset[str]]
) -> Iterator[PrintedMean]:
    """Printed means at no wished place, and not of an effect that is wished away."""
    for mean in means:
        if mean.at not in places and not any(effect <= set(mean.at) for effect in gone):
            yield mean


def _factors(direction: Direction) -> set[str]:
    places = (direction.higher, direction.lower, direction.order, direction.highest)
    return {factor for at in places if at for factor in at}


def _mean(text: str, space: DesignSpace) -> PrintedMean:
    place_text, sign, value = text.rpartition("=")
    # From the right, since names of factors may contain dots.
    parts = [part.strip().rpartition(".") for part in place_text.split(",")]
    if not sign or not all(factor and level for factor, _, level in parts):
        raise InputError(f"expected a mean as factor.level=4.80, got '{text}'")
    at = {factor: level for factor, _, level in parts}
    # Only for its errors about unknown factors and levels.
    space.weights(at)
    number = _number(value, text)
    # At least two decimals: a wish for 4.8 means 4.80, not anything from 4.75 to 4.85.
    return PrintedMean(at=at, printed=f"{number:.{max(2, decimals(value.strip()))}f}")


def _test(text: str, space: DesignSpace) -> PrintedTest:
    name, sign, value = text.rpartition("=")
    if not sign:
        raise InputError(f"expected an effect as blur:amplitude=20.35 (its F), got '{text}'")
    number = _number(value, text)
    return PrintedTest(
        effect=space.effect_called(name.strip()), f=f"{number:.{max(2, decimals(value.strip()))}f}"
    )


def _number(value: str, text: str) -> float:
    try:
        number = float(value)
    except ValueError:
        raise InputError(f"expected a number after '=', got '{text}'") from None
    # Refuses NaN as well, with which every comparison is false.
    if not 0 <= number < 1e6:
        raise InputError(f"expected a number from 0 to a million after '=', got '{text}'")
    return number


# Wishes for one scale of several: `eeriness/character=9`; without a name a wish holds for every scale.


def wishes_for(experiment: Experiment, scale: RatedScale, wishes: Sequence[str]) -> list[str]:
    """The wishes that hold for a scale, without its name before them.

    Raises
    ------
    InputError
        A wish for a scale that the study does not have.
    """
    names = [known.name for known in scales_of(experiment)]
    held = []
    for wish in wishes:
        name, slash, rest = wish.partition("/")
        if slash and name not in names:
            raise InputError(f"'{experiment.name}' has no scale '{name}'{did_you_mean(name, names)}")
        if not slash or name == scale.name:
            held.append(rest if slash else wish)
    return held


def refuse_off_scale(means: Sequence[PrintedMean], experiment: Experiment, scale: RatedScale) -> None:
    """InputError for the first mean that ratings on this scale cannot have."""
    for mean in means:
        if not scale.minimum <= float(mean.printed) <= scale.maximum:
            several = len(scales_of(experiment)) > 1
            hint = "; name the scale that it is of, as SCALE/factor.level=..." if several else ""
            raise InputError(
                f"expected means from {scale.minimum:g} to {scale.maximum:g} on the scale '{scale.name}', "
                f"got {mean.printed}{hint}"
            )
