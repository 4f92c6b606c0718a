"""Options of `analysis plan`, and what stands in them."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from analysis.commands.output import names_in
from experiments.errors import InputError

SizesOption = Annotated[
    str, typer.Option("--n", help="Numbers of participants: first:last:step, or 20,30,43.")
]
SimulationsOption = Annotated[int, typer.Option(help="Data sets a number of participants.", min=1)]
AlphaOption = Annotated[float, typer.Option(help="Level of the tests.", min=1e-6, max=0.5)]
PowerOption = Annotated[float, typer.Option("--power", help="Power to look for.", min=0.01, max=0.999)]
SeedOption = Annotated[int, typer.Option(help="Same seed, same numbers.", min=0)]
PlotOption = Annotated[
    Path | None, typer.Option(help="Draw the curves into this PNG, SVG or PDF.", show_default=False)
]


class ShapeChoice(StrEnum):
    """Shapes of psychometric functions."""

    NORMAL = "normal"
    LOGISTIC = "logistic"
    WEIBULL = "weibull"


def levels_in(text: str, option: str) -> dict[str, int]:
    """Numbers of levels by factor, of `face:3,blur:2`."""
    levels: dict[str, int] = {}
    for part in names_in(text):
        name, _, count = part.partition(":")
        if not name or not count.isdecimal() or int(count) < 2 or name in levels:
            raise InputError(
                f"{option} should be like face:3,blur:2 (names and numbers of levels), got '{text}'"
            )
        levels[name] = int(count)
    return levels


def effects_in(given: list[str]) -> dict[str, float]:
    """Cohen's f by effect, of texts like `face=0.25`."""
    sizes: dict[str, float] = {}
    for text in given:
        name, _, size = text.partition("=")
        try:
            sizes[name.strip()] = float(size)
        except ValueError:
            raise InputError(f"--effect should be like face=0.25 or face:group=0.1, got '{text}'") from None
        if not 0 <= sizes[name.strip()] < 10:
            raise InputError(
                f"--effect takes Cohen's f from 0 (small .1, medium .25, large .4), got '{text}'"
            )
    return sizes


def numbers_in(text: str, option: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    try:
        return tuple(float(part) for part in names_in(text))
    except ValueError:
        raise InputError(f"{option} should be numbers separated by commas, got '{text}'") from None


def counts_in(text: str, option: str) -> tuple[int, ...]:
    """Whole numbers from 1, separated by commas."""
    parts = names_in(text)
    if not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise InputError(f"{option} should be whole numbers separated by commas, got '{text}'")
    return tuple(int(part) for part in parts)
