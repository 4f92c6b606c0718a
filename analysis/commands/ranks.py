"""`analysis ranks`: rank tests of one factor."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer

from analysis.commands.output import JsonOption, LevelsOption, save_json, scale_bounds, show_tables
from experiments.errors import InputError


def register_ranks(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="ranks")(ranks)


def ranks(
    file: Annotated[Path, typer.Argument(help="CSV file, one row per trial (or one per cell).")],
    participant: Annotated[str, typer.Option(help="Column that names the participant.")],
    rating: Annotated[str, typer.Option(help="Column with the rating.")],
    within: Annotated[str | None, typer.Option(help="Column of a factor within participants.")] = None,
    between: Annotated[str | None, typer.Option(help="Column of a factor between participants.")] = None,
    scale: Annotated[str | None, typer.Option(help="Ends of the scale, e.g. 1:7.")] = None,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Rank tests of one factor: Friedman and Wilcoxon, or Kruskal-Wallis, Mann-Whitney and Dunn.

    Trials are first averaged to one value per participant and level. Pairs are corrected by Holm and
    Bonferroni.

    Examples:

      analysis ranks ratings.csv --participant id --rating score --within face

      analysis ranks ratings.csv --participant id --rating score --between group --json ranks.json
    """
    from analysis.ranks import rank_between, rank_within
    from analysis.read.long_csv import read_long_table
    from analysis.report.rank_tables import levels_table, pairs_table
    from analysis.within.cell_means import cell_table
    from analysis.within.level_codes import in_given_order

    if (within is None) == (between is None):
        raise InputError("expected one factor: either --within COLUMN or --between COLUMN")
    factor = within or between or ""
    columns = ([factor], []) if within else ([], [factor])
    data = read_long_table(file, participant, rating, columns[0], None, scale_bounds(scale), columns[1])
    rows, ordered = in_given_order(data.rows, levels or ())
    if within:
        cells = cell_table(rows, participant, rating, [factor])
        result = rank_within(factor, cells.levels[0], cells.y)
        result = replace(result, dropped=tuple(one.participant for one in cells.dropped))
    else:
        means = rows.groupby([factor, participant], observed=True, sort=False)[rating].mean()
        given = rows[factor].dtype
        names = list(given.categories) if hasattr(given, "categories") else sorted(set(rows[factor]))
        names = [name for name in names if name in set(rows[factor])]
        result = rank_between(factor, names, [means[name].to_numpy(dtype=float) for name in names])
    result = replace(result, decisions=(*data.decisions, *ordered))
    save_json(json, asdict(result), data.synthetic)
    for decision in result.decisions:
        typer.echo(f"- {decision}")
    if result.dropped:
        typer.echo(f"- left out, without a rating at every level: {', '.join(result.dropped)}")
    show_tables(
        levels_table(result, file.stem, data.synthetic), pairs_table(result, file.stem, data.synthetic)
    )
