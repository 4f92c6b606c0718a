"""`analysis reliability`, `analysis agreement` and `analysis opinion`."""

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import (
    JsonOption,
    LevelsOption,
    names_in,
    progress_spinner,
    save_json,
    scale_bounds,
    show_figure,
    show_tables,
    show_text,
)
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.report.contents import Picture

MAX_DRAWN = 40
"""Items in a figure of opinion scores."""

# `analysis reliability` and `analysis agreement`.


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
    app.command(name="opinion")(opinion)


def reliability(
    file: Annotated[
        Path, typer.Argument(help="One row per case (a person, or a rated clip), one column per item.")
    ],
    items: Annotated[str, typer.Option(help="Columns of the items of one scale, separated by commas.")],
    reverse: Annotated[str, typer.Option(help="Items that are reverse-keyed.")] = "",
    scale: Annotated[
        str | None, typer.Option(help="Ends of the scale, e.g. 1:7; required by --reverse.")
    ] = None,
    case: Annotated[str | None, typer.Option(help="Column with the name of the case, for --scores.")] = None,
    scores: Annotated[
        Path | None, typer.Option(help="Write each case's scale score to this CSV file.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Reliability of a scale: Cronbach's alpha, McDonald's omega, item statistics, scale scores.

    Examples:

      analysis reliability answers.csv --items calm,glad,tense --reverse tense --scale 1:7

      analysis reliability answers.xlsx --items q1,q2,q3,q4 --case id --scores scores.csv --json out.json
    """
    from analysis import agreement as numbers
    from analysis.report.rating_tables import items_table, reliability_text
    from experiments.files import check_targets

    check_targets([scores])
    data = numbers.read_items(file, names_in(items), names_in(reverse), scale_bounds(scale), case)
    with progress_spinner("factor analysis"):
        result = numbers.reliability(data)
    save_json(json, asdict(result), data.synthetic)
    if scores is not None:
        _save_scores(scores, result.scores, case or "case")
    show_text(reliability_text(result, file.stem, data.synthetic))
    show_tables(items_table(result, file.stem, data.synthetic))


def agreement(
    file: Annotated[Path, typer.Argument(help="One row per rating, such as the server's export.")],
    item: Annotated[str, typer.Option(help="Column that names what was rated.")] = "stimulus",
    participant: Annotated[str, typer.Option(help="Column that names the person.")] = "participant",
    rating: Annotated[str, typer.Option(help="Column with the rating.")] = "response",
    level: Annotated[
        LevelChoice, typer.Option(help="What differences between ratings mean, for Krippendorff's alpha.")
    ] = LevelChoice.INTERVAL,
    by: Annotated[
        str | None, typer.Option(help="Column of the dimension, such as scale: each is analyzed separately.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Agreement between people who rated the same items: intraclass correlations, Krippendorff's alpha.

    Examples:

      analysis agreement ratings.csv

      analysis agreement votes.csv --item clip --participant id --rating score --level ordinal --json out.json

      analysis agreement ratings.csv --by scale
    """
    from analysis import agreement
    from analysis.report.rating_tables import agreement_text, intraclass_table
    from analysis.votes import read_votes_by

    votes = read_votes_by(file, (item, participant, rating), by)
    with progress_spinner("resampling items"):
        results = {name: agreement.agreement(own, level.value, name) for name, own in votes.items()}
    numbers = {name: asdict(result) for name, result in results.items()}
    synthetic = next(iter(votes.values())).synthetic
    save_json(json, numbers[""] if by is None else {"by": by, "dimensions": numbers}, synthetic)
    for name, result in results.items():
        title = f"{file.stem}, {name}" if name else file.stem
        show_text(agreement_text(result, title, synthetic))
        if result.icc:
            show_tables(intraclass_table(result, title, synthetic))


def _save_scores(path: Path, scores: tuple[tuple[str, float], ...], case: str) -> None:
    import csv

    from experiments.files import whole_file
    from table_files.formulas import guarded_row

    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(guarded_row([case, "score"]))
        out.writerows(guarded_row(score) for score in scores)
    typer.echo(f"written: {path} ({len(scores)} scale scores, the mean of the items)")


# `analysis opinion`.


class ScoreChoice(StrEnum):
    """How votes become scores."""

    ACR = "acr"
    ACR_HR = "acr-hr"
    CCR = "ccr"
    DSCQS = "dscqs"


class ScreenChoice(StrEnum):
    """The standard by which raters are excluded."""

    NONE = "none"
    BT500 = "bt500"
    P913 = "p913"


class RepeatsChoice(StrEnum):
    """How a person's repeated votes on one item are counted."""

    MEAN = "mean"
    VOTES = "votes"


def opinion(
    file: Annotated[Path, typer.Argument(help="CSV file, one row per vote, such as the server's export.")],
    item: Annotated[str, typer.Option(help="Column that names the clip or condition.")] = "stimulus",
    participant: Annotated[str, typer.Option(help="Column that names the person.")] = "participant",
    rating: Annotated[str, typer.Option(help="Column with the vote.")] = "response",
    method: Annotated[
        ScoreChoice,
        typer.Option(
            help=(
                "acr (absolute votes), acr-hr (DMOS against hidden references), ccr (comparisons with a "
                "reference) or dscqs (votes on item and reference)."
            )
        ),
    ] = ScoreChoice.ACR,
    reference: Annotated[
        str | None,
        typer.Option(
            help="acr-hr: column naming the item's hidden reference. dscqs: column of the reference's vote."
        ),
    ] = None,
    first: Annotated[
        str | None,
        typer.Option(
            help="ccr: column naming what was shown first; the vote on an item shown first is reversed."
        ),
    ] = None,
    scale: Annotated[str | None, typer.Option(help="acr-hr: ends of the scale, e.g. 1:5.")] = None,
    crush: Annotated[
        bool, typer.Option("--crush", help="acr-hr: crush scores above the scale's end, as P.910 may.")
    ] = False,
    z_scores: Annotated[
        bool, typer.Option("--z-scores", help="Standardize each person's votes (per session, if named).")
    ] = False,
    session: Annotated[str | None, typer.Option(help="Column of the session, for --z-scores.")] = None,
    screen: Annotated[
        ScreenChoice,
        typer.Option(help="Exclude unlike raters by bt500 or p913 (correlation with the mean below .75)."),
    ] = ScreenChoice.NONE,
    condition: Annotated[
        str | None,
        typer.Option(
            help=(
                "Column of what was done to the item (its codec), for --screen p913: raters whose means of "
                "conditions correlate by .8 or more stay."
            )
        ),
    ] = None,
    repeats: Annotated[
        RepeatsChoice,
        typer.Option(help="A person's repeated votes on an item: mean (n is people) or votes (n is votes)."),
    ] = RepeatsChoice.MEAN,
    by: Annotated[
        str | None, typer.Option(help="Column of the dimension, such as scale: each is analyzed separately.")
    ] = None,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Mean opinion scores with 95% intervals; bias and inconsistency of each person (ITU-T P.910).

    Examples:

      analysis opinion ratings.csv

      analysis opinion votes.csv --item clip --participant id --rating score --json mos.json

      analysis opinion votes.csv --method acr-hr --reference source --scale 1:5 --screen bt500

      analysis opinion votes.csv --z-scores --session day

      analysis opinion ratings.csv --by scale
    """
    from analysis.opinion import fit_opinion
    from analysis.report.rating_tables import opinion_text, raters_table, scores_table
    from analysis.votes import P913_BELOW, Screening, Standard, read_votes_by

    bounds = scale_bounds(scale)
    highest = None if bounds is None else bounds[1]
    standard = Standard(method.value, reference, first, highest, crush, z_scores, session, condition)
    if condition is not None and screen is not ScreenChoice.P913:
        raise InputError("--condition is for --screen p913; add it, or remove --condition")
    screening: Screening | None = None
    if screen is not ScreenChoice.NONE:
        screening = {"rule": "p913" if screen is ScreenChoice.P913 else "bt500", "below": P913_BELOW}
    with progress_spinner("reading votes"):
        votes = read_votes_by(file, (item, participant, rating), by, levels or (), standard, screening)
    results = {name: fit_opinion(own, repeats.value, standard) for name, own in votes.items()}
    numbers = {name: asdict(result) for name, result in results.items()}
    synthetic = next(iter(votes.values())).synthetic
    save_json(json, numbers[""] if by is None else {"by": by, "dimensions": numbers}, synthetic)
    for name, result in results.items():
        title = f"{file.stem}, {name}" if name else file.stem
        show_text(opinion_text(result, title, synthetic))
        rows = [(one.name, one.mos, one.ci_low, one.ci_high) for one in result.items]
        show_figure(partial(_draw_scores, rows, synthetic))
        show_tables(scores_table(result, title, synthetic), raters_table(result, title, synthetic))


def _draw_scores(rows: list[tuple[str, float, float, float]], synthetic: bool) -> "Picture":
    """Mean opinion scores, the best on top; of many items the best and the worst."""
    from analysis.report.pictures import draw_estimates

    ranked = sorted(rows, key=lambda row: -row[1])
    shown = ranked if len(ranked) <= MAX_DRAWN else ranked[: MAX_DRAWN // 2] + ranked[-MAX_DRAWN // 2 :]
    left_out = f" The best and the worst {MAX_DRAWN // 2} of {len(rows)}." if len(rows) > len(shown) else ""
    note = f"Bars: 95% intervals.{left_out}"
    return draw_estimates("figure-scores", "Mean opinion scores", "MOS", shown, note, synthetic)
