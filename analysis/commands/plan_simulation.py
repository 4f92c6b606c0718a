"""What every `analysis plan` does with its design: simulate, say, draw, write."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from analysis.commands.output import save_json
from analysis.commands.synthetic import bar, say_power

if TYPE_CHECKING:
    from analysis.power.designs import Design


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

    from analysis.power.designs import sample_size_text, simulate_design
    from analysis.power.simulate import sample_sizes
    from analysis.report.formats import wrap

    n, simulations, alpha, target, seed = asked
    sizes = sample_sizes(n)
    with bar("simulating", len(sizes) * simulations) as advance:
        result = simulate_design(design, name, sizes, simulations, alpha, seed, advance)
    text = sample_size_text(result, design, target, version("palpebra"))
    numbers = asdict(result) | {"power": result.power.tolist(), "se": result.se.tolist()}
    save_json(json, numbers | {"smallest_n": result.smallest_n(target), "text": text}, True)
    if plot is not None:
        from analysis.power.figure import save_power_figure

        save_power_figure(result, plot, target)
        typer.echo(f"written: {plot}")
    say_power(result, target)
    typer.echo("\n" + "\n".join(wrap(text)))
