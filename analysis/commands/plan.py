"""`analysis plan`: how many participants, clips and faces a study needs, before data collection."""

import sys
from dataclasses import asdict
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import JsonOption, names_in, save_json
from analysis.commands.synthetic import StatisticChoice, bar, say_power
from experiments.command_groups import command_group
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.power.simulate import Design


# Options of `analysis plan`, and their values.

SizesOption = Annotated[
    str, typer.Option("--n", help="Numbers of participants: first:last:step, or 20,30,43.")
]
SimulationsOption = Annotated[int, typer.Option(help="Data sets per number of participants.", min=1)]
AlphaOption = Annotated[float, typer.Option(help="Significance level of the tests.", min=1e-6, max=0.5)]
PowerOption = Annotated[float, typer.Option("--power", help="Target power.", min=0.01, max=0.999)]
SeedOption = Annotated[int, typer.Option(help="Random seed; the same seed gives the same numbers.", min=0)]
PlotOption = Annotated[
    Path | None, typer.Option(help="Draw the curves to this PNG, SVG or PDF file.", show_default=False)
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
        effect = ":".join(part.strip() for part in name.split(":"))
        if effect in sizes:
            raise InputError(f"--effect: {effect} has two sizes; give it once")
        try:
            sizes[effect] = float(size)
        except ValueError:
            raise InputError(f"--effect should be like face=0.25 or face:group=0.1, got '{text}'") from None
        if not 0 <= sizes[effect] < 10:
            raise InputError(
                f"--effect takes Cohen's f from 0 (small .1, medium .25, large .4), got '{text}'"
            )
    return sizes


def numbers_in(text: str, option: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    try:
        numbers = tuple(float(part) for part in names_in(text))
    except ValueError:
        numbers = (float("nan"),)
    # float() also reads nan and inf.
    if not all(map(isfinite, numbers)):
        raise InputError(f"{option} should be numbers separated by commas, got '{text}'")
    return numbers


def refuse_infinite(**options: float) -> None:
    """Refuse options that are not finite numbers, such as nan; named as in the function's arguments."""
    for name, value in options.items():
        if not isfinite(value):
            raise InputError(f"--{name.replace('_', '-')}: expected a number, got '{value:g}'")


def counts_in(text: str, option: str) -> tuple[int, ...]:
    """Whole numbers from 1, separated by commas."""
    parts = names_in(text)
    if not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise InputError(f"{option} should be whole numbers separated by commas, got '{text}'")
    return tuple(int(part) for part in parts)


# What every `analysis plan` does with its design: simulate, say, draw, write.


def simulate(
    design: "Design",
    name: str,
    asked: tuple[str, int, float, float, int],
    plot: Path | None,
    json: Path | None,
) -> None:
    """Simulate a design; print its power, and write the figure and the JSON where they are asked for.

    Parameters
    ----------
    design : Design
    name : str
        Of the design, in the table's title.
    asked : tuple
        Sizes as in 10:60:10, data sets of each, alpha, the power wanted, seed.
    plot, json : Path or None
    """
    from importlib.metadata import version

    from analysis.power.simulate import sample_size_text, sample_sizes, simulate_design
    from analysis.report.formats import wrap

    n, simulations, alpha, target, seed = asked
    sizes = sample_sizes(n)
    with bar("simulating", len(sizes) * simulations) as advance:
        result = simulate_design(design, name, sizes, simulations, alpha, seed, advance)
    text = sample_size_text(result, design, target, version("palpebra"))
    numbers = asdict(result) | {"power": result.power.tolist(), "se": result.se.tolist()}
    save_json(json, numbers | {"smallest_n": result.smallest_n(target), "text": text}, True)
    if plot is not None:
        from analysis.report.pictures import save_power_figure

        save_power_figure(result, plot, target)
        typer.echo(f"written: {plot}")
    say_power(result, target)
    typer.echo("\n" + "\n".join(wrap(text)))


# `analysis plan pairs` and `thresholds`: sample sizes of choices and psychometric trials.


def pairs(
    abilities: Annotated[
        str,
        typer.Option(
            help="Log odds of the items: 0,0.3,0.6. A difference of 1 means winning 73% of the time."
        ),
    ],
    repeats: Annotated[int, typer.Option(help="Comparisons of each pair by a participant.", min=1)] = 1,
    sd_rater: Annotated[
        float, typer.Option(help="SD over participants of the log odds of a pair.", min=0)
    ] = 0.0,
    tie: Annotated[
        float, typer.Option(help="Probability of a tie between two equal items (Davidson).")
    ] = 0.0,
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
    from analysis.power.choices import PairsDesign

    refuse_infinite(sd_rater=sd_rater)
    design = PairsDesign(numbers_in(abilities, "--abilities"), repeats, sd_rater, tie)
    simulate(design, "paired comparisons", (n, simulations, alpha, target, seed), plot, json)
    _warn_of_likeness("--sd-rater", sd_rater)


def _warn_of_likeness(option: str, sd: float) -> None:
    if sd == 0:
        sys.stderr.write(
            f"warning: {option} is 0, as if everybody had the same effect, which finds too few people; "
            "estimate it from a pilot\n"
        )


def thresholds(
    levels: Annotated[str, typer.Option(help="Stimuli shown: 100,120,140,160.")],
    threshold: Annotated[float, typer.Option(help="Mean threshold of the first condition.")],
    difference: Annotated[
        float, typer.Option(help="Difference of the second condition's mean threshold from the first.")
    ],
    spread: Annotated[float, typer.Option(help="Spread of each person's function.")],
    sd_people: Annotated[float, typer.Option(help="SD of thresholds over people.")] = 0.0,
    sd_difference: Annotated[float, typer.Option(help="SD of differences over people.")] = 0.0,
    trials: Annotated[int, typer.Option(help="Trials per stimulus and condition.", min=1)] = 10,
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

      analysis plan thresholds --levels 90,120,140 --threshold 120 --difference 9 --spread 9 --sd-difference 7
    """
    from analysis.power.choices import ThresholdDesign

    refuse_infinite(
        threshold=threshold, difference=difference, spread=spread, sd_people=sd_people,
        sd_difference=sd_difference, guess=guess, lapse=lapse,
    )  # fmt: skip
    design = ThresholdDesign(
        numbers_in(levels, "--levels"), trials, threshold, difference, sd_people, sd_difference, spread,
        guess, lapse, function.value, seed,
    )  # fmt: skip
    simulate(design, "thresholds", (n, simulations, alpha, target, seed), plot, json)
    _warn_of_likeness("--sd-difference", sd_difference)


plan = command_group(
    "Sample size by simulation: participants, clips and faces for a target power, and a paragraph for the "
    "plan.",
    name="plan",
)


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    plan.command(name="pairs")(pairs)
    plan.command(name="thresholds")(thresholds)
    app.add_typer(plan)


@plan.command(name="anova")
def anova(
    within: Annotated[
        str, typer.Option(help="Factors within participants and their levels: face:3,blur:2.")
    ] = "",
    between: Annotated[str, typer.Option(help="Factors between participants: group:2.")] = "",
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help="Cohen's f of an effect: face=0.25, face:group=0.1 (small .1, medium .25, large .4). "
            "Repeatable."
        ),
    ] = None,
    correlation: Annotated[float, typer.Option(help="Correlation between two cells of a participant.")] = 0.5,
    statistic: Annotated[StatisticChoice, typer.Option(help="Which test.")] = (
        StatisticChoice.GREENHOUSE_GEISSER
    ),
    covariate: Annotated[
        float, typer.Option(help="Correlation of a covariate (ANCOVA) with participants' mean ratings.")
    ] = 0.0,
    n: SizesOption = "10:60:10",
    simulations: SimulationsOption = 500,
    alpha: AlphaOption = 0.05,
    target: PowerOption = 0.8,
    seed: SeedOption = 1,
    plot: PlotOption = None,
    json: JsonOption = None,
) -> None:
    """Plan a factorial design within, between or mixed.

    Examples:

      analysis plan anova --within face:3,blur:2 --effect face=0.2 --effect face:blur=0.15

      analysis plan anova --within face:3 --between group:2 --effect face:group=0.15 --n 20:80:20

      analysis plan anova --between group:2 --effect group=0.3 --covariate 0.5 --n 40:120:20
    """
    from analysis.power.factorial import FactorialDesign

    design = FactorialDesign(
        levels_in(within, "--within"), levels_in(between, "--between"), effects_in(effect or []), correlation,
        statistic.value, covariate,
    )  # fmt: skip
    simulate(design, "factorial design", (n, simulations, alpha, target, seed), plot, json)


@plan.command(name="mixed")
def mixed(
    difference: Annotated[
        str,
        typer.Option(
            help="Difference of each other condition from the first, in rating points: 0.4, or 0.2,0.4."
        ),
    ],
    clips: Annotated[str, typer.Option(help="Numbers of clips to try: 8,16,32.")] = "8,16",
    faces: Annotated[str, typer.Option(help="Numbers of faces in the clips to try: 2,4.")] = "",
    crossed: Annotated[
        bool,
        typer.Option(
            "--crossed", help="Show each clip in every condition. Default: each clip in one condition."
        ),
    ] = False,
    repeats: Annotated[int, typer.Option(help="Ratings per clip and participant.", min=1)] = 1,
    sd_participant: Annotated[float, typer.Option(help="SD of participants' mean ratings.", min=0)] = 0.6,
    sd_slope: Annotated[
        float, typer.Option(help="SD of participants' differences between conditions.", min=0)
    ] = 0.4,
    sd_clip: Annotated[float, typer.Option(help="SD of clips' mean ratings.", min=0)] = 0.3,
    sd_face: Annotated[float, typer.Option(help="SD of faces' mean ratings.", min=0)] = 0.3,
    sd_face_slope: Annotated[
        float, typer.Option(help="SD of faces' differences between conditions.", min=0)
    ] = 0.1,
    sd_residual: Annotated[float, typer.Option(help="Residual SD of a rating.", min=0.001)] = 1.0,
    n: SizesOption = "10:50:10",
    simulations: SimulationsOption = 200,
    alpha: AlphaOption = 0.05,
    target: PowerOption = 0.8,
    seed: SeedOption = 1,
    plot: PlotOption = None,
    json: JsonOption = None,
) -> None:
    """Plan a mixed model of conditions: participants, clips, and faces as random factors.

    Examples:

      analysis plan mixed --difference 0.4 --clips 8,16,32

      analysis plan mixed --difference 0.4 --clips 16 --faces 2,4,8 --n 20:60:20

      analysis plan mixed --difference 0.2,0.4 --clips 12,24
    """
    from analysis.power.models import MixedDesign, Spreads

    refuse_infinite(
        sd_participant=sd_participant, sd_slope=sd_slope, sd_clip=sd_clip, sd_face=sd_face,
        sd_face_slope=sd_face_slope, sd_residual=sd_residual,
    )  # fmt: skip
    spreads = Spreads(sd_participant, sd_slope, sd_clip, sd_face, sd_face_slope, sd_residual)
    design = MixedDesign(
        numbers_in(difference, "--difference"),
        counts_in(clips, "--clips"),
        counts_in(faces, "--faces"),
        crossed,
        repeats,
        spreads,
    )
    simulate(design, "mixed model", (n, simulations, alpha, target, seed), plot, json)


@plan.command(name="ordinal")
def ordinal(
    difference: Annotated[
        str,
        typer.Option(
            help=(
                "Difference of each other condition from the first, in log odds of a higher rating: 0.5 is "
                "1.65 to 1."
            )
        ),
    ],
    shares: Annotated[
        str, typer.Option(help="How often each rating is given in the first condition: 5,10,20,30,20,10,5.")
    ],
    clips: Annotated[
        int, typer.Option(help="Number of clips, divided evenly between conditions.", min=2)
    ] = 8,
    crossed: Annotated[
        bool,
        typer.Option(
            "--crossed", help="Show each clip in every condition. Default: each clip in one condition."
        ),
    ] = False,
    sd_participant: Annotated[float, typer.Option(help="SD of participants, in log odds.", min=0)] = 1.0,
    sd_slope: Annotated[
        float, typer.Option(help="SD of participants' differences between conditions.", min=0)
    ] = 0.5,
    sd_clip: Annotated[float, typer.Option(help="SD of clips.", min=0)] = 0.5,
    n: SizesOption = "10:50:10",
    simulations: SimulationsOption = 200,
    alpha: AlphaOption = 0.05,
    target: PowerOption = 0.8,
    seed: SeedOption = 1,
    plot: PlotOption = None,
    json: JsonOption = None,
) -> None:
    """Plan an ordinal mixed model of conditions: ratings as ordered categories.

    Examples:

      analysis plan ordinal --difference 0.5 --shares 5,10,20,30,20,10,5 --clips 16

      analysis plan ordinal --difference 0.4 --shares 1,2,4,2,1 --clips 8 --crossed --n 20:60:20

      analysis plan ordinal --difference 0.3,0.6 --shares 1,2,4,2,1 --clips 12
    """
    from analysis.power.models import OrdinalDesign

    refuse_infinite(sd_participant=sd_participant, sd_slope=sd_slope, sd_clip=sd_clip)
    design = OrdinalDesign(
        numbers_in(difference, "--difference"),
        numbers_in(shares, "--shares"),
        clips,
        crossed,
        sd_participant,
        sd_slope,
        sd_clip,
    )
    simulate(design, "ordinal mixed model", (n, simulations, alpha, target, seed), plot, json)
