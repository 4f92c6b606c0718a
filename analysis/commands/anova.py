"""`analysis anova`: anyone's long table."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from analysis.commands.output import (
    JsonOption,
    LevelsOption,
    VerifyOption,
    equivalence_bounds,
    names_in,
    progress_spinner,
    save_json,
    save_report,
    scale_bounds,
    show,
)
from experiments.errors import InputError
from experiments.files import check_folder


class ReportedTest(StrEnum):
    """Which F a report states first."""

    MULTIVARIATE = "multivariate"
    UNIVARIATE = "univariate"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="anova")(anova)


def anova(
    file: Annotated[
        Path,
        typer.Argument(
            help=(
                "CSV file, one row per trial (or per cell); or a folder, whose .csv files are read as one "
                "table."
            )
        ),
    ],
    participant: Annotated[str, typer.Option(help="Column that names the participant.")],
    rating: Annotated[str, typer.Option(help="Column with the number measured.")],
    within: Annotated[
        str, typer.Option(help="Columns of factors within participants, separated by commas.")
    ] = "",
    between: Annotated[
        str, typer.Option(help="Columns of factors between participants, separated by commas.")
    ] = "",
    covariate: Annotated[
        str, typer.Option(help="Columns of numbers that belong to participants, separated by commas.")
    ] = "",
    type: Annotated[int, typer.Option(help="Type of the sums of squares, 2 or 3.", min=2, max=3)] = 3,
    centre: Annotated[bool, typer.Option(help="Center covariates at their mean over participants.")] = True,
    covariate_by_group: Annotated[
        bool,
        typer.Option("--covariate-by-group", help="Allow slopes of covariates to differ between groups."),
    ] = False,
    json: JsonOption = None,
    out: Annotated[
        Path | None, typer.Option(help="Write figures and the whole report to this folder.")
    ] = None,
    trial: Annotated[
        str | None,
        typer.Option(help="Column with the number of a participant's trial; used to find repeated rows."),
    ] = None,
    scale: Annotated[str | None, typer.Option(help="Reject ratings outside this range, e.g. 1:7.")] = None,
    verify_with_r: VerifyOption = False,
    two_factor_pairs: Annotated[
        bool, typer.Option("--two-factor-pairs", help="Also compare all cells of every two-factor margin.")
    ] = False,
    equivalence: Annotated[
        str | None,
        typer.Option(help="Bounds of equivalence of pairs, in rating units: 0.5 or -0.3,0.5."),
    ] = None,
    statistic: Annotated[
        ReportedTest,
        typer.Option(
            help="Test reported first: multivariate (Pillai), or univariate with Greenhouse-Geisser df."
        ),
    ] = ReportedTest.MULTIVARIATE,
    robust: Annotated[
        bool, typer.Option("--robust", help="Add permutation tests, aligned ranks and trimmed means.")
    ] = False,
    bayes: Annotated[
        bool,
        typer.Option(
            "--bayes",
            help="Add Bayes factors of the effects within participants (JZS), who may differ in effects.",
        ),
    ] = False,
    levels: LevelsOption = None,
    contrast: Annotated[
        list[str] | None,
        typer.Option(help="Weights of a factor's levels, in order: face:1,-1,0. Repeatable."),
    ] = None,
) -> None:
    """ANOVA of a long table: factors within and between participants, covariates, groups of any sizes.

    Examples:

      analysis anova ratings.csv --participant id --rating score --within face,blur

      analysis anova ratings.csv --participant id --rating score --within face,blur --json results.json

      analysis anova long.csv --participant id --rating score --within phase --between group --covariate age

      analysis anova ratings.csv --participant id --rating score --within face --robust --bayes

      analysis anova ratings.csv --participant id --rating score --within face --statistic univariate

    The JSON file has effects[], marginal_means[], pairwise[], dropped[], n_participants.
    """
    from analysis.plans.result import analysis_of
    from analysis.read.long_csv import design_of, read_long_table
    from analysis.read.text_table import refuse_ids_once
    from analysis.report.within_contents import contents_of
    from analysis.within.anova import linear_anova
    from analysis.within.cell_means import cell_table
    from analysis.within.level_codes import in_given_order

    factors, groups, covariates = names_in(within), names_in(between), names_in(covariate)
    if not [*factors, *groups, *covariates]:
        raise InputError("no factor is named; add, for example, --within face,blur or --between group")
    if out is not None:
        check_folder(out)
    elif verify_with_r:
        raise InputError("--verify-with-r needs a report folder: add, for example, --out results")
    with progress_spinner("reading ratings"):
        data = read_long_table(
            file, participant, rating, factors, trial, scale_bounds(scale), groups, covariates
        )
        rows, ordered = in_given_order(data.rows, levels or ())
        data = replace(data, rows=rows, decisions=(*data.decisions, *ordered))
        if factors:
            refuse_ids_once(data.rows, participant, data.header, data.source)
        cells = cell_table(data.rows, participant, rating, factors)
        people = cells.participants
        design = design_of(data.rows, participant, people, groups, covariates, centre, covariate_by_group)
        analysis = analysis_of(
            cells,
            linear_anova(cells.y, cells.factors, cells.levels, design, 2 if type == 2 else 3),
            name=file.stem,
            title=f"Analysis of {file.name}",
            source=data.source,
            rating=rating,
            synthetic=data.synthetic,
            two_factor_pairs=two_factor_pairs,
            equivalence_bounds=equivalence_bounds(equivalence),
            planned_contrasts=[_contrast(text) for text in contrast or ()],
            decisions=data.decisions,
            univariate=statistic is ReportedTest.UNIVARIATE,
        )
    if robust:
        # scipy.stats takes a second to import: only commands that use it import it
        from analysis.robust import companions_of

        with progress_spinner("permutations"):
            analysis = replace(analysis, robust=companions_of(analysis.anova))
    if bayes:
        from analysis.within.bayes import bayes_anova

        with progress_spinner("Bayes factors"):
            analysis = replace(analysis, bayes=bayes_anova(analysis.anova))
    contents = contents_of(analysis)
    # before what is printed, which `| head` may cut off
    save_json(json, contents.numbers)
    if out is not None:
        save_report(contents, out, with_r=verify_with_r)
    show(contents)


def _contrast(text: str) -> tuple[str, list[float]]:
    factor, _, weights = text.rpartition(":")
    try:
        return factor.strip(), [float(weight) for weight in weights.split(",")]
    except ValueError:
        raise InputError(f"--contrast should be like face:1,-1,0, got '{text}'") from None
