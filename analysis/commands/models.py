"""`analysis mixed` and `analysis ordinal`."""

from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from analysis.commands.output import (
    JsonOption,
    LevelsOption,
    equivalence_bounds,
    names_in,
    progress_spinner,
    refuse_unwritable,
    save_json,
    show_decisions,
    show_figure,
    show_tables,
    show_text,
)
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.models.columns import Slopes
    from analysis.models.means import ModelMeans
    from analysis.models.ordinal import OrdinalResult
    from analysis.models.random_part import MixedResult
    from analysis.read.model_csv import ModelInput
    from analysis.report.contents import Picture


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


FormulaOption = Annotated[
    str | None,
    typer.Option(
        help=(
            "The model as R writes it, instead of the options for columns and slopes: "
            "'rating ~ a*b*age + (1 + a | person) + (1 | clip)'. Columns of numbers are covariates; "
            "factor(x) treats x as a factor."
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


ResidualsOption = Annotated[
    Path | None,
    typer.Option(
        help=(
            "Check residuals: tests by simulated ratings, and a figure (PNG or SVG) with residuals over "
            "fitted values, normal quantiles and simulated ranks."
        ),
        callback=refuse_unwritable,
    ),
]


EquivalenceOption = Annotated[
    str | None,
    typer.Option(
        help="With --means: bounds of equivalence of pairs, 0.5 or -0.3,0.5; in ordinal on the logit scale."
    ),
]


def _bounds(text: str | None, means: bool) -> tuple[float, float] | None:
    if text is not None and not means:
        raise InputError("--equivalence tests pairs of marginal means: add --means")
    return equivalence_bounds(text)


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


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="mixed")(mixed)
    app.command(name="ordinal")(ordinal)


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
            help="Denominator df; kenward-roger also enlarges standard errors where participants are few."
        ),
    ] = DfChoice.SATTERTHWAITE,
    intervals: Annotated[
        bool,
        typer.Option("--intervals", help="Add profile likelihood intervals of coefficients and SDs."),
    ] = False,
    formula: FormulaOption = None,
    means: MeansOption = False,
    likelihood_ratio: RatioOption = False,
    residuals: ResidualsOption = None,
    equivalence: EquivalenceOption = None,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Linear mixed model: participants crossed with clips, slopes, Satterthwaite or Kenward-Roger tests.

    Examples:

      analysis mixed ratings.csv

      analysis mixed table.csv --participant id --rating score --within face,blur --item clip --slopes main

      analysis mixed table.csv --within blur --between group --covariate age --item clip --random face,lab

      analysis mixed ratings.csv --df kenward-roger --intervals

      analysis mixed ratings.csv --means --likelihood-ratio --residuals residuals.png

      analysis mixed table.csv --formula 'score ~ face*age + (1 + face | id) + (1 | clip)' --means
    """
    _refuse_format(residuals)
    from analysis.models.mixed import fit_mixed
    from analysis.report.rating_tables import (
        means_tables,
        mixed_coefficients_table,
        mixed_components_table,
        mixed_effects_table,
        mixed_text,
    )

    model = _Model(
        participant,
        rating,
        names_in(within),
        names_in(item),
        names_in(between),
        names_in(covariate),
        names_in(random),
        None if slopes is SlopesChoice.ALL else slopes.value,
    )
    model, data = _read_model(file, model, formula, levels)
    with progress_spinner("fitting") as say:
        result = fit_mixed(
            data.rows,
            model.participant,
            model.rating,
            data.within,
            data.item,
            cast("Slopes", model.slopes or "all"),
            model.between,
            model.covariates,
            model.random,
            effects=model.effects,
            slope_effects=model.slope_effects,
            group_slopes=model.group_slopes,
            correlated_slopes=model.correlated_slopes,
            df_method=df.value,
            intervals=intervals,
            means=means,
            likelihood_ratio=likelihood_ratio,
            residuals=residuals is not None,
            equivalence=_bounds(equivalence, means),
            progress=say,
        )
    save_json(json, asdict(result), data.synthetic)
    _show(file, data, mixed_text(result))
    named = (result, file.stem, data.synthetic)
    tables = [mixed_effects_table(*named), mixed_components_table(*named)]
    show_tables(*tables, *([mixed_coefficients_table(*named)] if intervals else []), *means_tables(*named))
    _show_residuals(residuals, *named)
    if result.means is not None:
        show_figure(partial(_draw_means, result.means, model.rating, data.synthetic))


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
    formula: FormulaOption = None,
    means: MeansOption = False,
    likelihood_ratio: RatioOption = False,
    residuals: ResidualsOption = None,
    equivalence: EquivalenceOption = None,
    levels: LevelsOption = None,
    json: JsonOption = None,
) -> None:
    """Cumulative-link (ordinal) mixed model: logit, flexible thresholds, crossed effects, slopes.

    Examples:

      analysis ordinal ratings.csv

      analysis ordinal table.csv --participant id --rating score --within face,blur --item clip --slopes main

      analysis ordinal table.csv --participant id --rating score --within face --quadrature 10

      analysis ordinal ratings.csv --means --likelihood-ratio

      analysis ordinal table.csv --formula 'score ~ face + age + (1 + face || id) + (1 + age || clip)'
    """
    _refuse_format(residuals)
    from analysis.models.ordinal import fit_ordinal
    from analysis.report.rating_tables import (
        means_tables,
        ordinal_coefficients_table,
        ordinal_components_table,
        ordinal_effects_table,
        ordinal_text,
    )

    model = _Model(
        participant,
        rating,
        names_in(within),
        names_in(item),
        names_in(between),
        names_in(covariate),
        [],
        None if slopes is OrdinalSlopesChoice.NONE else slopes.value,
    )
    model, data = _read_model(file, model, formula, levels)
    if model.random:
        more = ", ".join(model.random)
        raise InputError(f"the ordinal model has participants and one more grouping; remove {more}")
    clips = data.item if quadrature in (None, 1) or model.item else ()
    with progress_spinner("fitting"):
        result = fit_ordinal(
            data.rows,
            model.participant,
            model.rating,
            data.within,
            clips,
            # Covariates that correlate with the intercept are refused as all that correlate are.
            "correlated" if model.correlated_slopes else cast("Slopes", model.slopes or "none"),
            model.between,
            model.covariates,
            quadrature,
            effects=model.effects,
            slope_effects=model.slope_effects,
            # A formula for this model names one grouping besides the participants.
            item_slopes=next((effects for _, effects in model.group_slopes), ()),
            means=means,
            likelihood_ratio=likelihood_ratio,
            residuals=residuals is not None,
            equivalence=_bounds(equivalence, means),
        )
    save_json(json, asdict(result), data.synthetic)
    _show(file, data, ordinal_text(result))
    named = (result, file.stem, data.synthetic)
    tables = (ordinal_effects_table, ordinal_coefficients_table, ordinal_components_table)
    show_tables(*(table(*named) for table in tables), *means_tables(*named))
    _show_residuals(residuals, *named)
    if result.means is not None:
        show_figure(partial(_draw_means, result.means, f"{model.rating}, logits", data.synthetic))


@dataclass(frozen=True)
class _Model:
    """Which columns a model is of; `slopes`, `effects` and `slope_effects` are None where not given."""

    participant: str
    rating: str
    within: list[str]
    item: list[str]
    between: list[str]
    covariates: list[str]
    random: list[str]
    slopes: str | None
    effects: tuple[str, ...] | None = None
    slope_effects: tuple[str, ...] = ()
    group_slopes: tuple[tuple[str, tuple[str, ...]], ...] = ()
    correlated_slopes: tuple[str, ...] | None = None


def _read_model(
    file: Path, model: _Model, formula: str | None, levels: list[str] | None
) -> "tuple[_Model, ModelInput]":
    """What a model is fitted to, from a file of any kind that is read; a formula replaces the options."""
    from analysis.models.formula import model_options, parse_formula
    from analysis.read.model_csv import header_and_numbers, read_model_input
    from analysis.read.text_table import refuse_ids_once
    from analysis.within.level_codes import in_given_order

    if formula is not None:
        given = (model.within, model.item, model.between, model.covariates, model.random, model.slopes)
        if any(given) or (model.participant, model.rating) != ("participant", "response"):
            raise InputError("--formula names all columns and slopes; remove the other options for them")
        options = model_options(parse_formula(formula), *header_and_numbers(file))
        model = _Model(
            options.participant,
            options.rating,
            list(options.factors),
            list(options.item),
            [],
            list(options.covariates),
            list(options.random),
            options.slopes,
            options.effects,
            options.slope_effects,
            options.group_slopes,
            options.correlated_slopes,
        )
    columns = (model.within, model.item, model.between, model.covariates, model.random)
    with progress_spinner("reading ratings"):
        data = read_model_input(
            file, model.participant, model.rating, *columns, no_predictors=formula is not None
        )
    refuse_ids_once(data.rows, model.participant, data.header, file.name)
    rows, ordered = in_given_order(data.rows, levels or ())
    decisions = [*data.decisions, *ordered]
    if formula is not None and (numbers := [name for name in model.covariates if ":" not in name]):
        decisions.append(
            f"columns of numbers are covariates: {', '.join(numbers)}; factor(x) treats x as a factor"
        )
    return model, replace(data, rows=rows, decisions=tuple(decisions))


def _refuse_format(path: Path | None) -> None:
    if path is not None and path.suffix not in (".png", ".svg"):
        raise InputError(f"--residuals writes a figure: expected a name in .png or .svg, got '{path.name}'")


def _show_residuals(
    path: Path | None, result: "MixedResult | OrdinalResult", name: str, synthetic: bool
) -> None:
    """The table of residual checks, and their figure in the format that the file's name says."""
    from analysis.report.figures import residuals_figure
    from analysis.report.rating_tables import residuals_table
    from experiments.files import whole_file

    if path is None or result.residuals is None:
        return
    show_tables(residuals_table(result.residuals, name, synthetic))
    picture = residuals_figure(result.residuals, synthetic)
    with whole_file(path) as temporary:
        temporary.write_bytes(picture.svg if path.suffix == ".svg" else picture.png)
    typer.echo(f"written: {path}")


def _show(file: Path, data: "ModelInput", text: str) -> None:
    if data.synthetic:
        typer.echo("SYNTHETIC DATA: no person gave these ratings")
    show_text(f"{file.name}: {text}")
    show_decisions(data.decisions)


def _draw_means(means: "ModelMeans", rating: str, synthetic: bool) -> "Picture":
    """The means of single factors; of a model without factors, its trends."""
    from analysis.report.pictures import draw_estimates

    single = [one for one in means.means if len(one.levels) == 1]
    rows = [(", ".join(one.levels.values()), one.estimate, *one.ci) for one in single]
    rows = rows or [(one.covariate, one.estimate, *one.ci) for one in means.trends]
    note = "Bars: 95% intervals of the model."
    return draw_estimates("figure-means", "Marginal means", rating, rows, note, synthetic)
