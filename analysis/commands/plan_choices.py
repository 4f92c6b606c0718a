"""`analysis plan pairs` and `thresholds`: sample sizes of choices and psychometric trials."""

from typing import Annotated

import typer

from analysis.commands.output import JsonOption
from analysis.commands.plan_options import (
    AlphaOption,
    PlotOption,
    PowerOption,
    SeedOption,
    ShapeChoice,
    SimulationsOption,
    SizesOption,
    numbers_in,
)
from analysis.commands.plan_simulation import simulate


def pairs(
    abilities: Annotated[
        str, typer.Option(help="Log odds of the items: 0,0.3,0.6. One above another wins 73% of the time.")
    ],
    repeats: Annotated[int, typer.Option(help="Comparisons of each pair by a participant.", min=1)] = 1,
    sd_rater: Annotated[float, typer.Option(help="SD of participants' own log odds of a pair.", min=0)] = 0.0,
    tie: Annotated[float, typer.Option(help="Probability that two equal items tie (Davidson).")] = 0.0,
    n: SizesOption = "10:60:10",
    simulations: SimulationsOption = 500,
    alpha: AlphaOption = 0.05,
    target: PowerOption = 0.8,
    seed: SeedOption = 1,
    plot: PlotOption = None,
    json: JsonOption = None,
) -> None:
    """Plan paired comparisons: whether items differ, and each item against the next best.

    Examples:

      analysis plan pairs --abilities 0,0.3,0.6,0.9 --n 10:40:10

      analysis plan pairs --abilities 0,0.5 --repeats 4 --sd-rater 0.5

      analysis plan pairs --abilities 0,0.3,0.6 --tie 0.2
    """
    from analysis.power.paired_comparisons import PairsDesign

    design = PairsDesign(numbers_in(abilities, "--abilities"), repeats, sd_rater, tie)
    simulate(design, "paired comparisons", (n, simulations, alpha, target, seed), plot, json)


def thresholds(
    levels: Annotated[str, typer.Option(help="Stimuli shown: 100,120,140,160.")],
    threshold: Annotated[float, typer.Option(help="Mean threshold of the first condition.")],
    difference: Annotated[float, typer.Option(help="How much higher that of the second is.")],
    spread: Annotated[float, typer.Option(help="Spread of a person's function.")],
    sd_people: Annotated[float, typer.Option(help="SD of thresholds over people.")] = 0.0,
    sd_difference: Annotated[float, typer.Option(help="SD of differences over people.")] = 0.0,
    trials: Annotated[int, typer.Option(help="Trials of each stimulus in a condition.", min=1)] = 10,
    guess: Annotated[float, typer.Option(help="Guess rate: 0 for yes/no, 0.5 for two alternatives.")] = 0.0,
    lapse: Annotated[float, typer.Option(help="Lapse rate.")] = 0.0,
    function: Annotated[ShapeChoice, typer.Option(help="Shape of the function.")] = ShapeChoice.NORMAL,
    n: SizesOption = "6:30:6",
    simulations: SimulationsOption = 500,
    alpha: AlphaOption = 0.05,
    target: PowerOption = 0.8,
    seed: SeedOption = 1,
    plot: PlotOption = None,
    json: JsonOption = None,
) -> None:
    """Plan a comparison of thresholds in two conditions, each person in both.

    Examples:

      analysis plan thresholds --levels 100,120,140,160 --threshold 130 --difference 8 --spread 12
    """
    from analysis.power.thresholds import ThresholdDesign

    design = ThresholdDesign(
        numbers_in(levels, "--levels"), trials, threshold, difference, sd_people, sd_difference, spread,
        guess, lapse, function.value, seed,
    )  # fmt: skip
    simulate(design, "thresholds", (n, simulations, alpha, target, seed), plot, json)
