"""`analysis mixed` and `analysis ordinal`."""

from dataclasses import asdict, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import (
    JsonOption,
    LevelsOption,
    names_in,
    progress_spinner,
    save_json,
    show_tables,
)

if TYPE_CHECKING:
    from analysis.read.model_csv import ModelInput


FileArgument = Annotated[
    Path, typer.Argument(help="CSV file, one row per trial, such as the server's export.")
]
ParticipantOption = Annotated[str, typer.Option(help="Column that names the participant.")]
RatingOption = Annotated[str, typer.Option(help="Column with the rating.")]
WithinOption = Annotated[
    str,
    typer.Option(
        help="Columns of the within factors, separated by commas. Default: the factors of an export."
    ),
]
ItemOption = Annotated[
    str,
    typer.Option(
        help=(
            "Column that names the clip (or what clips share, such as the blink shown). Several columns, "
            "separated by commas, name it together. Default: profile_id of an export."
        )
    ),
]


BetweenOption = Annotated[
    str,
    typer.Option(help="Columns of factors with one level for each participant, separated by commas."),
]
CovariateOption = Annotated[
    str,
    typer.Option(
        help=(
            "Columns with numbers (age, trial), separated by commas; they are centered. age:blur or "
            "age:trial adds an interaction with a factor or another covariate."
        )
    ),
]
RandomOption = Annotated[
    str,
    typer.Option(
        help=(
            "Additional columns with a random intercept each, separated by commas: face, or face/clip for "
            "clips nested in faces."
        )
    ),
]


MeansOption = Annotated[
    bool,
    typer.Option("--means", help="Add marginal means, their pairs (Tukey, Holm), and trends of covariates."),
]
RatioOption = Annotated[
    bool, typer.Option("--likelihood-ratio", help="Add likelihood-ratio tests of the fixed effects.")
]


class SlopesChoice(StrEnum):
    """By-participant slopes of the linear mixed model."""

    ALL = "all"
    MAIN = "main"
    CORRELATED = "correlated"
    NONE = "none"


class DfChoice(StrEnum):
    """Denominator df of the linear mixed model's tests."""

    SATTERTHWAITE = "satterthwaite"
    KENWARD_ROGER = "kenward-roger"


class OrdinalSlopesChoice(StrEnum):
    """By-participant slopes of the ordinal model, which do not correlate."""

    ALL = "all"
    MAIN = "main"
    NONE = "none"


def register_models(app: typer.Typer) -> None:
    """Add the commands to `app`, those on synthetic participants too."""
    from analysis.commands.synthetic import register_synthetic

    app.command(name="mixed")(mixed)
    app.command(name="ordinal")(ordinal)
    register_synthetic(app)


def mixed(
    file: FileArgument,
    participant: ParticipantOption = "participant",
    rating: RatingOption = "response",
    within: WithinOption = "",
    item: ItemOption = "",
    between: BetweenOption = "",
    covariate: CovariateOption = "",
    random: RandomOption = "",
    slopes: Annotated[
        SlopesChoice,
        typer.Option(
            help=(
                "all: a separate variance for every effect; main: for main effects; correlated: main "
                "effects and intercept with all correlations; none: intercepts only (anti-conservative)."
            )
        ),
    ] = SlopesChoice.ALL,
    df: Annotated[
        DfChoice,
        typer.Option(
            help="Denominator df; kenward-roger also corrects standard errors for few participants."
        ),
    ] = DfChoice.SATTERTHWAITE,
    intervals: Annotated[
        bool,
        typer.Option("--intervals", help="Add profile likelihood intervals of coefficients and SDs."),
    ] = False,
    means: MeansOption = False,
    likelihood_ratio: RatioOption = False,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Linear mixed model: participants crossed with clips, slopes, Satterthwaite or Kenward-Roger tests.

    Examples:

      analysis mixed ratings.csv

      analysis mixed table.csv --participant id --rating score --within face,blur --item clip --slopes main

      analysis mixed table.csv --within blur --between group --covariate age --item clip --random face,lab

      analysis mixed ratings.csv --df kenward-roger --intervals

      analysis mixed ratings.csv --means --likelihood-ratio
    """
    from analysis.models.mixed import fit_mixed
    from analysis.report.rating_tables import (
        means_tables,
        mixed_coefficients_table,
        mixed_components_table,
        mixed_effects_table,
        mixed_text,
    )

    groups, numbers, further = names_in(between), names_in(covariate), names_in(random)
    data = _read_model_input(file, participant, rating, within, item, levels, groups, numbers, further)
    with progress_spinner("fitting") as say:
        result = fit_mixed(
            data.rows,
            participant,
            rating,
            data.within,
            data.item,
            slopes.value,
            groups,
            numbers,
            further,
            df_method=df.value,
            intervals=intervals,
            means=means,
            likelihood_ratio=likelihood_ratio,
            progress=say,
        )
    save_json(json, asdict(result), data.synthetic)
    _show(file, data, mixed_text(result))
    named = (result, file.stem, data.synthetic)
    tables = [mixed_effects_table(*named), mixed_components_table(*named)]
    show_tables(*tables, *([mixed_coefficients_table(*named)] if intervals else []), *means_tables(*named))


def ordinal(
    file: FileArgument,
    participant: ParticipantOption = "participant",
    rating: RatingOption = "response",
    within: WithinOption = "",
    item: ItemOption = "",
    between: BetweenOption = "",
    covariate: CovariateOption = "",
    slopes: Annotated[
        OrdinalSlopesChoice,
        typer.Option(
            help=(
                "all: a separate variance for every effect; main: for main effects; none: intercepts only "
                "(anti-conservative if people differ in an effect)."
            )
        ),
    ] = OrdinalSlopesChoice.NONE,
    quadrature: Annotated[
        int | None,
        typer.Option(
            help=(
                "Nodes of adaptive Gauss-Hermite quadrature, for models with participants' intercepts only "
                "(the item of an export is then ignored). 1 is Laplace's approximation. Default: as many "
                "nodes as needed; with items or slopes Laplace, with a warning if it is inaccurate."
            ),
            min=1,
            max=100,
        ),
    ] = None,
    means: MeansOption = False,
    likelihood_ratio: RatioOption = False,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Cumulative-link (ordinal) mixed model: logit, flexible thresholds, crossed effects, slopes.

    Examples:

      analysis ordinal ratings.csv

      analysis ordinal table.csv --participant id --rating score --within face,blur --item clip --slopes main

      analysis ordinal table.csv --participant id --rating score --within face --quadrature 10

      analysis ordinal ratings.csv --means --likelihood-ratio
    """
    from analysis.models.ordinal import fit_ordinal
    from analysis.report.rating_tables import (
        means_tables,
        ordinal_coefficients_table,
        ordinal_components_table,
        ordinal_effects_table,
        ordinal_text,
    )

    groups, numbers = names_in(between), names_in(covariate)
    data = _read_model_input(file, participant, rating, within, item, levels, groups, numbers)
    clips = data.item if quadrature in (None, 1) or item else ()
    with progress_spinner("fitting"):
        result = fit_ordinal(
            data.rows,
            participant,
            rating,
            data.within,
            clips,
            slopes.value,
            groups,
            numbers,
            quadrature,
            means=means,
            likelihood_ratio=likelihood_ratio,
        )
    save_json(json, asdict(result), data.synthetic)
    _show(file, data, ordinal_text(result))
    named = (result, file.stem, data.synthetic)
    tables = (ordinal_effects_table, ordinal_coefficients_table, ordinal_components_table)
    show_tables(*(table(*named) for table in tables), *means_tables(*named))


def _read_model_input(
    file: Path,
    participant: str,
    rating: str,
    within: str,
    item: str,
    levels: list[str] | None,
    *further: list[str],
) -> "ModelInput":
    """What a model is fitted to, from a file of any kind that is read.

    Parameters
    ----------
    levels : list of str or None
        Orders of levels.
    further : list of str
        Factors between participants, covariates, and more groupings.
    """
    from analysis.read.model_csv import read_model_input
    from analysis.read.text_table import refuse_ids_once
    from analysis.within.level_codes import in_given_order

    with progress_spinner("reading ratings"):
        data = read_model_input(file, participant, rating, names_in(within), names_in(item), *further)
    refuse_ids_once(data.rows, participant, data.header, file.name)
    rows, ordered = in_given_order(data.rows, levels or ())
    return replace(data, rows=rows, decisions=(*data.decisions, *ordered))


def _show(file: Path, data: "ModelInput", text: str) -> None:
    from analysis.report.formats import wrap

    if data.synthetic:
        typer.echo("SYNTHETIC DATA: no person gave these ratings")
    for said in (f"{file.name}: {text}", *(f"- {decision}" for decision in data.decisions)):
        typer.echo("\n".join(wrap(said)))
