"""A paper's printed figures, as a TOML file that keeps every digit as printed."""

import tomllib
from dataclasses import dataclass
from decimal import ROUND_DOWN, Decimal
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from experiments.declaration.base import Declaration
from experiments.errors import InputError, did_you_mean

SHIPPED = Path(__file__).parent / "published" / "FIGURES.toml"

Number = Annotated[str, Field(pattern=r"^-?[0-9]*\.?[0-9]+$")]
Probability = Annotated[str, Field(pattern=r"^[<>]?[0-9]*\.?[0-9]+$")]


@dataclass(frozen=True)
class PrintedInterval:
    """What a printed number can have been before rounding: low <= value < high."""

    printed: Decimal
    low: Decimal
    high: Decimal

    @classmethod
    def of(cls, text: str) -> "PrintedInterval":
        """Half a unit of the last printed digit to either side."""
        value = Decimal(text)
        half = Decimal(1).scaleb(int(value.as_tuple().exponent)) / 2
        return cls(value, value - half, value + half)

    @property
    def unit(self) -> Decimal:
        """One unit of the last printed digit."""
        return Decimal(1).scaleb(int(self.printed.as_tuple().exponent))

    def cut(self, value: Decimal) -> Decimal:
        """`value` cut off after as many digits as are printed here."""
        return value.quantize(self.unit, rounding=ROUND_DOWN)


class PrintedMean(Declaration):
    """A mean of a margin or cell, with its error where one is printed and what it is called there."""

    at: dict[str, str]
    mean: Number
    error: Number | None = None
    error_name: Literal["SE", "SD"] = "SE"
    where: str = ""

    @property
    def name(self) -> str:
        """The levels in words."""
        return " ".join(self.at.values())


class PrintedTest(Declaration):
    """F with its df and p, as far as printed."""

    effect: str
    f: Number
    df: tuple[int, int] | None = None
    p: Probability | None = None
    where: str = ""

    @property
    def name(self) -> str:
        """The test in words."""
        df = f"({self.df[0]}, {self.df[1]})" if self.df else ""
        bracketed = f" [{self.where}]" if self.where else ""
        return f"{self.effect} F{df} = {self.f}{bracketed}"


class CorrectionMention(Declaration):
    """A correction for multiple testing that the paper mentions, and for how many tests it would be."""

    what: str
    method: Literal["Bonferroni"] = "Bonferroni"
    tests: Annotated[int, Field(ge=1)]


class PrintedStudy(Declaration):
    """One study: its design and everything printed about it. All factors are within participants."""

    name: str
    participants: Annotated[int, Field(ge=2)]
    scale: tuple[float, float] | None = None
    balanced: bool = True
    factors: dict[str, tuple[str, ...]]
    corrected: CorrectionMention | None = None
    mean: tuple[PrintedMean, ...] = ()
    test: tuple[PrintedTest, ...] = ()

    @model_validator(mode="after")
    def _known(self) -> Self:
        for mean in self.mean:
            for factor, level in mean.at.items():
                if factor not in self.factors:
                    raise ValueError(f"no factor is called '{factor}'{did_you_mean(factor, self.factors)}")
                if level not in self.factors[factor]:
                    hint = did_you_mean(level, self.factors[factor])
                    raise ValueError(f"'{level}' is not a level of '{factor}'{hint}")
        for test in self.test:
            for factor in test.effect.split(":"):
                if factor not in self.factors:
                    raise ValueError(f"no factor is called '{factor}'{did_you_mean(factor, self.factors)}")
        return self

    def contrasts(self, effect: str) -> int:
        """Number of contrasts q of an effect."""
        q = 1
        for factor in effect.split(":"):
            q *= len(self.factors[factor]) - 1
        return q


class PrintedPaper(Declaration):
    """A paper's studies."""

    title: str
    source: str = ""
    study: Annotated[tuple[PrintedStudy, ...], Field(min_length=1)]


def load_figures(path: Path) -> PrintedPaper:
    """Read a figures file; InputError names the first thing wrong in it."""
    if not path.is_file():
        raise InputError(f"there is no file {path}; omit the name to check the shipped figures of the paper")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not valid TOML: {error}") from error
    try:
        return PrintedPaper.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{path.name}: {_first(error)}") from error


def _first(error: ValidationError) -> str:
    detail = error.errors()[0]
    path = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in detail["loc"])
    message = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "extra_forbidden":
        known = {name for model in _MODELS for name in model.model_fields}
        message = f"unknown key{did_you_mean(str(detail['loc'][-1]), sorted(known))}"
    elif detail["type"] == "string_pattern_mismatch":
        message = f"expected a number as printed, in quotes, got {detail['input']!r}"
    return f"{path}: {message}"


_MODELS = (PrintedPaper, PrintedStudy, PrintedMean, PrintedTest, CorrectionMention)
