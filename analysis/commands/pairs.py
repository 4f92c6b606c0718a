"""`analysis pairs`."""

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from analysis.commands.output import JsonOption, save_json, saying, show_tables, show_text


class MethodChoice(StrEnum):
    """Model of the comparisons."""

    BRADLEY_TERRY = "bradley-terry"
    DAVIDSON = "davidson"
    THURSTONE = "thurstone"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="pairs")(pairs)


def pairs(
    file: Annotated[
        Path, typer.Argument(help="CSV file, one row a comparison, such as the server's export.")
    ],
    left: Annotated[str, typer.Option(help="Column of the item on the left (or shown first).")] = "left",
    right: Annotated[str, typer.Option(help="Column of the item on the right (or shown second).")] = "right",
    winner: Annotated[
        str, typer.Option(help="Column of the winner: left, right, or the item's name.")
    ] = "winner",
    tie: Annotated[str | None, typer.Option(help="What stands in the winner's column for a tie.")] = None,
    participant: Annotated[
        str | None, typer.Option(help="Column that names the rater, for robust standard errors.")
    ] = None,
    method: Annotated[
        MethodChoice | None,
        typer.Option(help="bradley-terry, davidson (ties) or thurstone (case V); by the ties if not given."),
    ] = None,
    factors: Annotated[
        Path | None,
        typer.Option(
            help="CSV of the items: first column the item, the others factors; abilities are linear in them."
        ),
    ] = None,
    order_effect: Annotated[
        bool, typer.Option("--order-effect", help="Let the left (first) side have an advantage.")
    ] = False,
    firth: Annotated[
        bool, typer.Option("--firth", help="Finite estimates also where an item always wins (penalised).")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Abilities of items from paired comparisons.

    Examples:

      analysis pairs comparisons.csv --json abilities.json

      analysis pairs table.csv --left a --right b --winner choice --tie same --participant id

      analysis pairs table.csv --method thurstone --factors items.csv
    """
    from analysis.pairs.abilities import fit_abilities
    from analysis.pairs.comparisons import read_comparisons
    from analysis.pairs.factors import read_item_factors
    from analysis.pairs.likelihood import Method
    from analysis.report.pairs_tables import abilities_table, contrasts_table, factors_table, pairs_text

    with saying("reading comparisons"):
        comparisons = read_comparisons(file, left, right, winner, tie, participant)
        design = None if factors is None else read_item_factors(factors)
    usual: Method = "davidson" if comparisons.ties else "bradley-terry"
    chosen: Method = method.value if method else usual
    with saying("fitting"):
        result = fit_abilities(comparisons, chosen, order_effect=order_effect, firth=firth, factors=design)
    save_json(json, asdict(result), comparisons.synthetic)
    show_text(pairs_text(result, file.stem, comparisons.synthetic))
    show_tables(abilities_table(result, file.stem, comparisons.synthetic))
    if design is not None:
        show_tables(factors_table(result, file.stem, comparisons.synthetic))
    show_tables(contrasts_table(result, file.stem, comparisons.synthetic))
