"""`analysis opinion`."""

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from analysis.commands.output import JsonOption, save_json, saying, show_tables, show_text


class RepeatsChoice(StrEnum):
    """What a person's repeated votes on one item count as."""

    MEAN = "mean"
    VOTES = "votes"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="opinion")(opinion)


def opinion(
    file: Annotated[Path, typer.Argument(help="CSV file, one row a vote, such as the server's export.")],
    item: Annotated[str, typer.Option(help="Column that names the clip or condition.")] = "stimulus",
    participant: Annotated[str, typer.Option(help="Column that names the person.")] = "participant",
    rating: Annotated[str, typer.Option(help="Column with the vote.")] = "response",
    repeats: Annotated[
        RepeatsChoice,
        typer.Option(help="A person's repeated votes on an item: mean (n is people) or votes (n is votes)."),
    ] = RepeatsChoice.MEAN,
    json: JsonOption = None,
) -> None:
    """Mean opinion scores with 95% intervals; bias and inconsistency of each person (ITU-T P.910).

    Examples:

      analysis opinion ratings.csv

      analysis opinion votes.csv --item clip --participant id --rating score --json mos.json
    """
    from analysis.opinion.scores import fit_opinion, read_votes
    from analysis.report.opinion_tables import opinion_text, raters_table, scores_table

    with saying("reading votes"):
        votes = read_votes(file, item, participant, rating)
    result = fit_opinion(votes, repeats.value)
    save_json(json, asdict(result), votes.synthetic)
    show_text(opinion_text(result, file.stem, votes.synthetic))
    show_tables(
        scores_table(result, file.stem, votes.synthetic), raters_table(result, file.stem, votes.synthetic)
    )
