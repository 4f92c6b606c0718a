"""`analysis power` and `analysis synthesise`: what is made from synthetic participants."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from analysis.commands.output import JsonOption, progress_spinner, save_json, show_tables
from experiments.files import check_targets

if TYPE_CHECKING:
    from analysis.power.simulate import PowerResult
    from analysis.synthetic.synthesise import Synthetic


MeanOption = Annotated[
    list[str] | None,
    typer.Option(
        help=(
            "A different mean: profile.real=4.80 or blur.MB,amplitude.FC=4.9; for one of several scales: "
            "eeriness/character.cartoon=60. Repeatable."
        )
    ),
]
EffectOption = Annotated[
    list[str] | None,
    typer.Option(
        help=(
            "A different effect size, as F: blur:amplitude=12.5; =0 for none; for one of several scales: "
            "eeriness/character=9. Repeatable."
        )
    ),
]


class StatisticChoice(StrEnum):
    """Which test the power is that of."""

    MULTIVARIATE = "multivariate"
    GREENHOUSE_GEISSER = "greenhouse-geisser"


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="power")(power)
    app.command(name="synthesise")(synthesise_command)


def power(
    experiment: Annotated[str, typer.Argument(help="exp1 to exp3, or another rating study with --effect.")],
    n: Annotated[str, typer.Option("--n", help="Sample sizes: first:last:step, or 20,30,43.")] = "10:60:5",
    simulations: Annotated[int, typer.Option(help="Data sets per sample size.", min=1)] = 1000,
    alpha: Annotated[float, typer.Option(help="Significance level of the tests.")] = 0.05,
    statistic: Annotated[StatisticChoice, typer.Option(help="Which test.")] = StatisticChoice.MULTIVARIATE,
    scale: Annotated[
        str | None,
        typer.Option(help="Scale of the ratings, if there are several. Default: the first."),
    ] = None,
    target: Annotated[float, typer.Option("--wanted", help="Target power.", min=0.01, max=0.999)] = 0.8,
    seed: Annotated[int, typer.Option(help="Random seed; the same seed gives the same numbers.", min=0)] = 1,
    mean: MeanOption = None,
    effect: EffectOption = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="PNG, SVG or PDF; default out/analysis/NAME/power.png.", show_default=False),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Power of every effect of known size, by simulation from synthetic participants.

    Examples:

      analysis power exp1 --n 10:60:5

      analysis power exp2 --n 20,30,43 --effect profile=6.5 --plot power.svg

      analysis power sliders-demo --scale eeriness --effect character=9 --effect blink=4
    """
    from analysis.power.simulate import sample_sizes, simulate_power
    from analysis.report.pictures import save_power_figure
    from analysis.synthetic.synthesise import make_plan

    sizes = sample_sizes(n)
    plan = make_plan(experiment, means=mean or (), effects=effect or (), scale=scale)
    figure = plot or Path("out") / "analysis" / experiment / "power.png"
    with bar("simulating", len(sizes) * simulations) as advance:
        result = simulate_power(plan, sizes, simulations, alpha, seed, statistic.value, advance)
    save_power_figure(result, figure, target)
    numbers = asdict(result) | {"power": result.power.tolist(), "se": result.se.tolist()}
    save_json(json, numbers | {"smallest_n": result.smallest_n(target)}, True)
    typer.echo(f"written: {figure}")
    say_power(result, target)


def synthesise_command(
    experiment: Annotated[str, typer.Argument(help="exp1 to exp3, or another rating study with --effect.")],
    seed: Annotated[int, typer.Option(help="Random seed; the same seed gives the same file.", min=0)] = 1,
    out: Annotated[
        Path, typer.Option(help="CSV file to write, with the columns of the server's export.")
    ] = Path("ratings.csv"),
    n: Annotated[
        int | None, typer.Option("--n", help="Number of participants. Default: as in the paper.")
    ] = None,
    mean: MeanOption = None,
    effect: EffectOption = None,
) -> None:
    """Generate ratings of synthetic participants whose analysis gives the published figures.

    Every row is marked as synthetic. Nothing made from these ratings is a replication. Figures that are
    inconsistent with each other are listed. Exit code 1 if a figure was not reached.

    Examples:

      analysis synthesise exp1 --seed 7 --out ratings.csv

      analysis synthesise exp3 --effect lower_lid=6 --mean lower_lid.both=4.90 --out larger.csv

      analysis synthesise sliders-demo --effect character=9 --effect eeriness/blink=4 --out scales.csv
    """
    from analysis.synthetic.synthesise import make_plans, synthesise
    from analysis.synthetic.trials import write_ratings

    check_targets([out])
    plans = make_plans(experiment, n, mean or (), effect or ())
    with progress_spinner("searching"):
        scales = [synthesise(plan, seed) for plan in plans]
    rows = write_ratings(scales, out)
    for plan, made in zip(plans, scales, strict=True):
        _say_synthetic(made, len(plan.published.invented_means), several=len(scales) > 1)
    typer.echo(f"written: {out} ({rows} synthetic ratings of {len(scales[0].sums)} synthetic participants)")
    if any(made.missed for made in scales):
        raise typer.Exit(1)


def say_power(result: "PowerResult", target: float) -> None:
    """Print power at up to six sample sizes, and the smallest that reaches the target."""
    from analysis.report.formats import Table
    from analysis.report.numbers import fixed

    smallest = result.smallest_n(target)
    shown = list(range(0, len(result.n), max(1, -(-len(result.n) // 6))))
    rows = tuple(
        (effect, *(fixed(float(row[i])) for i in shown), str(smallest[effect] or f">{result.n[-1]}"))
        for effect, row in zip(result.effects, result.power, strict=True)
    )
    header = ("Effect", *(f"n={result.n[i]}" for i in shown), f"n for {target:g}")
    notes = (f"Test: {result.statistic}. {result.simulations} synthetic data sets per sample size.",)
    show_tables(Table("power", f"Power, {result.experiment}", header, rows, 1, notes))


def _say_synthetic(made: "Synthetic", invented: int, several: bool) -> None:
    from analysis.report.formats import wrap

    hit = sum(r.hit for r in made.reached)
    of = f"{made.experiment.name}, scale {made.scale.name}" if several else made.experiment.name
    typer.echo(f"SYNTHETIC {of}, seed {made.seed}: {hit} of {len(made.reached)} figures reached")
    if not made.reached:
        typer.echo("- no effect was specified for this scale; differences are due to chance")
    if invented:
        said = f"- invented: {invented} means that the paper does not print, to complete the data"
        typer.echo("\n".join(wrap(said)))
    for given in made.given_way:
        typer.echo("\n".join(wrap(f"- {given}")))
    for missed in made.missed:
        window = f"{missed.low:.4f} to {missed.high:.4f}"
        said = f"- not reached: {missed.name}: target {window}, got {missed.value:.4f}"
        typer.echo("\n".join(wrap(said)))


@contextmanager
def bar(what: str, total: int) -> Iterator[Any]:
    """A progress bar with the time left on a terminal, silence elsewhere."""
    # rich takes longer to import than all else that the help of any command needs
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True, markup=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(what, total=total)
        yield lambda count: progress.advance(task, count)
