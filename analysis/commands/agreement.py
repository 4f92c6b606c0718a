"""`analysis reliability` and `analysis agreement`."""

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from analysis.commands.output import JsonOption, names_in, save_json, saying, show_tables, show_text


class LevelChoice(StrEnum):
    """What differences between ratings mean."""

    NOMINAL = "nominal"
    ORDINAL = "ordinal"
    INTERVAL = "interval"
    RATIO = "ratio"


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="reliability")(reliability)
    app.command(name="agreement")(agreement)


def reliability(
    file: Annotated[
        Path, typer.Argument(help="One row a case (a person, or a rated clip), a column an item.")
    ],
    items: Annotated[str, typer.Option(help="Columns of the items of one scale, separated by commas.")],
    reverse: Annotated[str, typer.Option(help="Those of them that are reverse-keyed.")] = "",
    scale: Annotated[
        str | None, typer.Option(help="Ends of the scale, e.g. 1:7; needed by --reverse.")
    ] = None,
    case: Annotated[str | None, typer.Option(help="Column that names the case, for its scale score.")] = None,
    scores: Annotated[
        Path | None, typer.Option(help="Write each case's scale score to this CSV file.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Whether items measure one thing: Cronbach's alpha, McDonald's omega, each item, scale scores.

    Examples:

      analysis reliability answers.csv --items calm,glad,tense --reverse tense --scale 1:7

      analysis reliability answers.xlsx --items q1,q2,q3,q4 --case id --scores scores.csv --json out.json
    """
    from analysis.agreement import reliability as numbers
    from analysis.commands.scale_option import scale_bounds
    from analysis.report.agreement_tables import items_table, reliability_text
    from experiments.files import check_targets

    check_targets([scores])
    data = numbers.read_items(file, names_in(items), names_in(reverse), scale_bounds(scale), case)
    with saying("factor analysis"):
        result = numbers.reliability(data)
    save_json(json, asdict(result), data.synthetic)
    if scores is not None:
        _save_scores(scores, result.scores, case or "case")
    show_text(reliability_text(result, file.stem, data.synthetic))
    show_tables(items_table(result, file.stem, data.synthetic))


def agreement(
    file: Annotated[Path, typer.Argument(help="One row a rating, such as the server's export.")],
    item: Annotated[str, typer.Option(help="Column that names what was rated.")] = "stimulus",
    participant: Annotated[str, typer.Option(help="Column that names the person.")] = "participant",
    rating: Annotated[str, typer.Option(help="Column with the rating.")] = "response",
    level: Annotated[
        LevelChoice, typer.Option(help="What differences between ratings mean, for Krippendorff's alpha.")
    ] = LevelChoice.INTERVAL,
    json: JsonOption = None,
) -> None:
    """Whether people say the same of the same items: intraclass correlations, Krippendorff's alpha.

    Examples:

      analysis agreement ratings.csv

      analysis agreement votes.csv --item clip --participant id --rating score --level ordinal --json out.json
    """
    from analysis.agreement import raters
    from analysis.opinion.scores import read_votes
    from analysis.report.agreement_tables import agreement_text, intraclass_table

    votes = read_votes(file, item, participant, rating)
    with saying("resampling items"):
        result = raters.agreement(votes, level.value)
    save_json(json, asdict(result), votes.synthetic)
    show_text(agreement_text(result, file.stem, votes.synthetic))
    if result.icc:
        show_tables(intraclass_table(result, file.stem, votes.synthetic))


def _save_scores(path: Path, scores: tuple[tuple[str, float], ...], case: str) -> None:
    import csv

    from experiments.files import whole_file
    from experiments.spreadsheet import guarded_row

    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(guarded_row([case, "score"]))
        out.writerows(guarded_row(score) for score in scores)
    typer.echo(f"written: {path} ({len(scores)} scale scores, the mean of the items)")
