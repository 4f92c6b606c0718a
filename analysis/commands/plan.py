"""`analysis plan`: how many participants, clips and faces a study needs, before there are data."""

from typing import Annotated

import typer

from analysis.commands.output import JsonOption
from analysis.commands.plan_choices import pairs, thresholds
from analysis.commands.plan_options import (
    AlphaOption,
    PlotOption,
    PowerOption,
    SeedOption,
    SimulationsOption,
    SizesOption,
    counts_in,
    effects_in,
    levels_in,
    numbers_in,
)
from analysis.commands.plan_simulation import simulate
from analysis.commands.synthetic import StatisticChoice
from experiments.command_groups import command_group

plan = command_group(
    "Sample size by simulation: participants, clips and faces for a power, and a text that says so.",
    name="plan",
)


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
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
    correlation: Annotated[float, typer.Option(help="Between two cells of a participant.")] = 0.5,
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
        typer.Option(help="Of each further condition from the first, in rating points: 0.4, or 0.2,0.4."),
    ],
    clips: Annotated[str, typer.Option(help="Numbers of clips, each tried: 8,16,32.")] = "8,16",
    faces: Annotated[str, typer.Option(help="Numbers of faces that the clips are of, each tried: 2,4.")] = "",
    crossed: Annotated[
        bool, typer.Option("--crossed", help="Each clip in every condition; else as many in each.")
    ] = False,
    repeats: Annotated[int, typer.Option(help="Ratings of a clip by a participant.", min=1)] = 1,
    sd_participant: Annotated[float, typer.Option(help="SD of participants' mean ratings.", min=0)] = 0.6,
    sd_slope: Annotated[float, typer.Option(help="SD of participants' differences.", min=0)] = 0.4,
    sd_clip: Annotated[float, typer.Option(help="SD of clips' mean ratings.", min=0)] = 0.3,
    sd_face: Annotated[float, typer.Option(help="SD of faces' mean ratings.", min=0)] = 0.3,
    sd_face_slope: Annotated[float, typer.Option(help="SD of faces' differences.", min=0)] = 0.1,
    sd_residual: Annotated[float, typer.Option(help="SD of a rating's rest.", min=0.001)] = 1.0,
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
    from analysis.power.mixed_models import MixedDesign, Spreads

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
            help="Of each further condition from the first, in log odds of a higher rating: 0.5 is 1.65 to 1."
        ),
    ],
    shares: Annotated[
        str, typer.Option(help="How often each rating is given in the first condition: 5,10,20,30,20,10,5.")
    ],
    clips: Annotated[int, typer.Option(help="Clips, shared evenly by the conditions.", min=2)] = 8,
    crossed: Annotated[
        bool, typer.Option("--crossed", help="Each clip in every condition; else as many in each.")
    ] = False,
    sd_participant: Annotated[float, typer.Option(help="SD of participants, in log odds.", min=0)] = 1.0,
    sd_slope: Annotated[float, typer.Option(help="SD of participants' differences.", min=0)] = 0.5,
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
    from analysis.power.ordinal_models import OrdinalDesign

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
