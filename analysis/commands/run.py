"""`analysis run` (a declared experiment) and `analysis anova` (anyone's long table)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import names_in
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.plans.result import Analysis
    from analysis.report.write import Section


class Origin(StrEnum):
    """Whose answers count; said here once more so that `--help` needs no numerics."""

    PARTICIPANT = "participant"
    PILOT = "pilot"
    SIMULATED = "simulated"
    ALL = "all"


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="run")(run)
    app.command(name="anova")(anova)


def run(
    experiment: Annotated[str, typer.Argument(help="exp1, exp2, exp3, or an experiment's TOML file.")],
    database: Annotated[
        str | None,
        typer.Option(
            help="Database URL; without it and without --csv: DATABASE_URL, or palpebra.sqlite in the data "
            "folder (PALPEBRA_DATA_FOLDER, default ./data).",
            show_default=False,
        ),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="A CSV export instead of a database.")] = None,
    study: Annotated[str | None, typer.Option(help="Name of the study, where there are several.")] = None,
    origin: Annotated[
        Origin | None,
        typer.Option(
            help="Whose answers; without it the first there are of participant, pilot and simulated.",
            show_default=False,
        ),
    ] = None,
    series: Annotated[
        int | None,
        typer.Option(min=1, help="Data series; without it the latest.", show_default=False),
    ] = None,
    version: Annotated[
        int | None, typer.Option(min=1, help="One version of the study alone.", show_default=False)
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the report; default out/analysis/NAME.", show_default=False)
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write every number to this JSON file too.")] = None,
    report: Annotated[bool, typer.Option(help="Write figures and report, or only print the tables.")] = True,
    sensitivity: Annotated[
        bool, typer.Option(help="Add mixed and ordinal models and Bayes factors to the report.")
    ] = True,
) -> None:
    """Analyse a study as its experiment declares: exclusions, the paper's table, every test, one report.

    Examples:

      analysis run exp3

      analysis run exp1 --csv ratings.csv --out results

      analysis run exp2 --database postgresql://me@host/palpebra --study spring

      analysis run exp1 --origin pilot --series 2
    """
    from analysis.errors import NoRatingsError
    from analysis.plans.study import analyse_study
    from analysis.read.database import default_url
    from analysis.read.pool import Origin as PoolOrigin
    from analysis.read.pool import Pool
    from analysis.read.study_ratings import load_csv, load_database
    from experiments.load import load_experiment

    if database is not None and csv is not None:
        raise InputError("--database and --csv exclude each other; give one")
    declared = load_experiment(experiment)
    pool = Pool(PoolOrigin(origin.value) if origin else None, series, version)
    try:
        with _working("reading ratings"):
            ratings = (
                load_csv(csv, declared, study)
                if csv is not None
                else load_database(database or default_url(), declared, study, report and sensitivity)
            )
            analysis = analyse_study(declared, ratings, pool)
    except NoRatingsError as error:
        typer.echo(f"nothing to analyse: {error}", err=True)
        raise typer.Exit(1) from None
    show(analysis)
    _save_json(analysis, json)
    if report:
        folder = out or Path("out") / "analysis" / declared.name
        _save_report(analysis, folder, _sensitivity(analysis) if sensitivity else ())


def anova(
    file: Annotated[Path, typer.Argument(help="CSV file, one row a trial (or one a cell).")],
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
    type: Annotated[int, typer.Option(help="Type of sums of squares, 2 or 3.", min=2, max=3)] = 3,
    centre: Annotated[bool, typer.Option(help="Centre covariates at their mean over participants.")] = True,
    covariate_by_group: Annotated[
        bool, typer.Option("--covariate-by-group", help="Let slopes of covariates differ between groups.")
    ] = False,
    json: Annotated[Path | None, typer.Option(help="Write every number to this JSON file.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write figures and the whole report to this folder.")
    ] = None,
    trial: Annotated[
        str | None, typer.Option(help="Column that numbers a participant's trials; repeats are found by it.")
    ] = None,
    scale: Annotated[str | None, typer.Option(help="Refuse ratings outside, e.g. 1:7.")] = None,
    two_factor_pairs: Annotated[
        bool, typer.Option("--two-factor-pairs", help="Also compare all cells of every two-factor margin.")
    ] = False,
    equivalence: Annotated[
        str | None,
        typer.Option(help="Bounds within which pairs count as equal, in rating units: 0.5 or -0.3,0.5."),
    ] = None,
    contrast: Annotated[
        list[str] | None,
        typer.Option(help="Weights of a factor's levels in their order: face:1,-1,0. Repeatable."),
    ] = None,
) -> None:
    """ANOVA of a long table: factors within and between participants, covariates, groups of any sizes.

    Examples:

      analysis anova ratings.csv --participant id --rating score --within face,blur

      analysis anova ratings.csv --participant id --rating score --within face,blur --json results.json

      analysis anova long.csv --participant id --rating score --within phase --between group --covariate age

    The JSON file has effects[], marginal_means[], pairwise[], dropped[], n_participants: docs/analysis.md.
    """
    from analysis.plans.result import analyse_cells
    from analysis.read.long_csv import read_long_table
    from analysis.read.participant_columns import design_of
    from analysis.within.cell_means import cell_table

    factors, groups, covariates = names_in(within), names_in(between), names_in(covariate)
    if not [*factors, *groups, *covariates]:
        raise InputError("no factor named; expected e.g. --within face,blur or --between group")
    with _working("reading ratings"):
        data = read_long_table(file, participant, rating, factors, trial, _scale(scale), groups, covariates)
        cells = cell_table(data.rows, participant, rating, factors)
        people = cells.participants
        analysis = analyse_cells(
            cells,
            between=design_of(data.rows, participant, people, groups, covariates, centre, covariate_by_group),
            sum_of_squares=2 if type == 2 else 3,
            name=file.stem,
            title=f"Analysis of {file.name}",
            source=data.source,
            rating=rating,
            synthetic=data.synthetic,
            two_factor_pairs=two_factor_pairs,
            equivalence_bounds=_bounds(equivalence),
            planned_contrasts=[_contrast(text) for text in contrast or ()],
            decisions=data.decisions,
        )
    show(analysis)
    _save_json(analysis, json)
    if out is not None:
        _save_report(analysis, out, ())


def show(analysis: "Analysis") -> None:
    """Print who was left out and the tables, at most 80 columns wide."""
    from analysis.report.formats import as_text, wrap
    from analysis.report.left_out import left_out
    from analysis.report.tables import all_tables

    lines = [analysis.title, f"{analysis.n_participants} participants, from {analysis.source}"]
    if analysis.synthetic:
        lines.append("SYNTHETIC DATA: no person gave these ratings")
    said = [*(left_out(analysis.exclusions) if analysis.exclusions else ()), *analysis.decisions]
    lines += [part for text in said for part in wrap(f"- {text}")]
    typer.echo("\n".join(lines))
    for table in all_tables(analysis):
        if table.folded:
            typer.echo(f"\n{table.title}: {len(table.rows)} rows, in the report and the JSON file")
        else:
            typer.echo("\n" + as_text(table))


def _bounds(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        given = [float(part) for part in text.split(",")]
    except ValueError:
        given = []
    if len(given) == 1:
        given = [-abs(given[0]), abs(given[0])]
    if len(given) != 2 or not given[0] < 0 < given[1]:
        raise InputError(f"--equivalence should be like 0.5 or -0.3,0.5, got '{text}'")
    return given[0], given[1]


def _contrast(text: str) -> tuple[str, list[float]]:
    factor, _, weights = text.rpartition(":")
    try:
        return factor.strip(), [float(weight) for weight in weights.split(",")]
    except ValueError:
        raise InputError(f"--contrast should be like face:1,-1,0, got '{text}'") from None


def _scale(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, _, high = text.partition(":")
    try:
        bounds = float(low), float(high)
    except ValueError:
        bounds = (1.0, 0.0)
    if not bounds[0] < bounds[1]:
        raise InputError(f"--scale should be like 1:7, got '{text}'")
    return bounds


@contextmanager
def _working(what: str) -> Iterator[Callable[[str], None]]:
    """A spinner on a terminal, silence elsewhere; gives a function that says which step is being taken."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _: None
        return
    with console.status(what) as status:
        yield lambda step: status.update(f"{what}: {step}")


def _save_json(analysis: "Analysis", path: Path | None) -> None:
    from analysis.report.json_output import as_json
    from experiments.files import whole_file

    if path is None:
        return
    with whole_file(path) as temporary:
        temporary.write_text(as_json(analysis), encoding="utf-8")
    typer.echo(f"\nwritten: {path}")


def _sensitivity(analysis: "Analysis") -> "tuple[Section, ...]":
    from analysis.plans.sensitivity import sensitivity_sections

    with _working("sensitivity analyses (--no-sensitivity leaves them out)") as say:
        return sensitivity_sections(analysis, say)


def _save_report(analysis: "Analysis", folder: Path, sections: "tuple[Section, ...]") -> None:
    from analysis.report.write import write_report

    with _working("writing") as say:
        paths = write_report(analysis, folder, sections, say)
    typer.echo(f"\nwritten to {folder}: {', '.join(path.name for path in paths)}")
