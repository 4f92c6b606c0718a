"""`analysis run`: a declared experiment, by the plan of its kind of trial."""

from dataclasses import replace
from enum import StrEnum
from os import environ
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import (
    JsonOption,
    VerifyOption,
    progress_spinner,
    save_json,
    save_report,
    show,
)
from experiments.errors import InputError
from experiments.files import check_folder

if TYPE_CHECKING:
    import pandas as pd

    from analysis.read.pool import Pool
    from experiments.declaration.experiment import Experiment
    from experiments.load import UnknownExperimentError


class Origin(StrEnum):
    """Whose answers count; said here once more so that `--help` needs no numerics."""

    PARTICIPANT = "participant"
    PILOT = "pilot"
    SIMULATED = "simulated"
    ALL = "all"


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="run")(run)


def run(
    experiment: Annotated[
        str, typer.Argument(help="exp1 to exp3, a demo, a TOML file, or a study in the database.")
    ],
    database: Annotated[
        str | None,
        typer.Option(
            help=(
                "Database URL. Default without --csv: DATABASE_URL, or palpebra.sqlite in the data folder "
                "(PALPEBRA_DATA_FOLDER, default ./data)."
            ),
            show_default=False,
        ),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="A CSV export instead of a database.")] = None,
    runs: Annotated[
        Path | None,
        typer.Option(
            help="The runs CSV (`server export --format runs`) with each run's verdict and signals.",
            show_default=False,
        ),
    ] = None,
    study: Annotated[str | None, typer.Option(help="Name of the study, if there are several.")] = None,
    origin: Annotated[
        Origin | None,
        typer.Option(
            help="Whose responses. Default: the first that exist of participant, pilot and simulated.",
            show_default=False,
        ),
    ] = None,
    series: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Data series: the responses of all versions that measure the same. Default: the latest "
            "one with responses to the definition given, else the latest.",
            show_default=False,
        ),
    ] = None,
    version: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Only responses to this version of the study, without the rest of its series.",
            show_default=False,
        ),
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option(help="One scale of a study with several scales. Default: all.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Report folder; default out/analysis/NAME.", show_default=False)
    ] = None,
    json: JsonOption = None,
    report: Annotated[
        bool, typer.Option(help="Write figures and the report, or only print the tables.")
    ] = True,
    sensitivity: Annotated[
        bool, typer.Option(help="Add slow parts to the report: mixed and ordinal models, Bayes factors.")
    ] = True,
    verify_with_r: VerifyOption = False,
    seal: Annotated[
        Path | None,
        typer.Option(help="Sealed plan (`server seal`): the report lists each deviation from it."),
    ] = None,
    manifest: Annotated[
        Path | None,
        typer.Option(help="manifest.json of the clips shown, to compare with the sealed plan."),
    ] = None,
) -> None:
    """Analyze a study as declared: exclusions, the paper's table, every test, and a report.

    Examples:

      analysis run exp3

      analysis run exp1 --csv ratings.csv --out results

      analysis run exp2 --database postgresql://me@host/palpebra --study spring

      analysis run exp1 --origin pilot --series 2

      analysis run exp1 --version 3

      analysis run sliders-demo --scale eeriness

      analysis run exp3 --csv ratings.csv --runs runs.csv --seal exp3-seal.json
    """
    from analysis.plans.plan import plan_of, study_contents
    from analysis.read.pool import Origin as PoolOrigin
    from analysis.read.pool import Pool
    from analysis.read.reading import NoRatingsError
    from analysis.read.study_answers import load_csv, read_runs
    from analysis.report.contents import held_against
    from experiments.load import is_shipped
    from experiments.seal import read_clips_sha256, read_seal

    if database is not None and csv is not None:
        raise InputError("--database and --csv cannot be combined; use one")
    if verify_with_r and not report:
        raise InputError("--verify-with-r needs the report; remove --no-report")
    pool = Pool(PoolOrigin(origin.value) if origin else None, series, version)
    url = None if csv else database or stored_at()
    declared, study = _declared_experiment(experiment, url, study, pool)
    folder = out or Path("out") / "analysis" / declared.name
    if report:
        check_folder(folder)
    try:
        with progress_spinner("reading answers"):
            if csv is not None:
                answers = load_csv(csv, declared, plan_of(declared.trial.kind).reading, study)
            else:
                # SQLAlchemy takes as long to import as numpy, and a CSV needs none of it
                from analysis.read.database import load_database

                url = database or stored_at()
                said: tuple[str, ...] = ()
                if is_shipped(experiment):
                    declared, said = _definition_in_use(declared, study, pool, url)
                reading = plan_of(declared.trial.kind).reading
                answers = load_database(url, declared, reading, study, report and sensitivity)
                answers = replace(answers, decisions=(*said, *answers.decisions))
            contents = study_contents(declared, answers, pool, read_runs(runs) if runs else None, scale)
    except NoRatingsError as error:
        typer.echo(f"nothing to analyze: {error}", err=True)
        raise typer.Exit(1) from None
    if seal is not None:
        clips = read_clips_sha256(manifest) if manifest else None
        contents = held_against(contents, read_seal(seal), declared, clips)
    # before what is printed, which `| head` may cut off
    save_json(json, contents.numbers)
    if report:
        save_report(contents, folder, more=sensitivity, with_r=verify_with_r)
    show(contents)


def stored_at() -> str:
    """DATABASE_URL, or the SQLite file in the server's data folder (PALPEBRA_DATA_FOLDER, else `data`)."""
    if environ.get("DATABASE_URL"):
        return environ["DATABASE_URL"]
    folder = environ.get("PALPEBRA_DATA_FOLDER") or "data"
    return f"sqlite:///{Path(folder) / 'palpebra.sqlite'}"


def _definition_in_use(
    shipped: "Experiment", study: str | None, pool: "Pool", url: str
) -> tuple["Experiment", tuple[str, ...]]:
    """The definition of the newest version that this pool's answers were given to, and decisions about it.

    It may be of another kind of trial than the shipped one.
    """
    from analysis.plans.plan import plan_of
    from analysis.read.database import answered_versions, database_name
    from analysis.read.pool import DECLARATION, VERSION, pooled
    from experiments.load import parse_experiment
    from experiments.schema.canonical import definition_sha256

    own, reading = definition_sha256(shipped), plan_of(shipped.trial.kind).reading
    answered = answered_versions(url, shipped, reading, study)
    if answered["study"].nunique() > 1:
        of_kind = answered[answered["trial_kind"] == shipped.trial.kind]
        answered = answered[answered["study"].isin(of_kind["study"])]
    # If there are several studies of this kind, none is chosen here: `load_database` lists them.
    if answered["study"].nunique() != 1:
        return shipped, ()
    # The same choice as among the answers themselves, whose columns these are.
    rows = pooled(answered, pool, database_name(url), own).rows
    newest = rows[rows[VERSION] == rows[VERSION].max()]
    if newest.empty:
        return shipped, ()
    # Answers of this kind in other series are counted where rows are pooled; the others are not among these.
    ignored = () if pool.series or pool.version else _said_of_other_kinds(answered, newest)
    if set(newest[DECLARATION]) <= {own, ""}:
        return shipped, ignored
    name, number = str(newest["study"].iloc[0]), int(newest[VERSION].iloc[0])
    toml = _definition_text(url, name, number, shipped.name)
    said = (
        f"study '{name}' was edited: its own definition (version {number}) is used, not the shipped "
        f"{shipped.name}"
    )
    typer.echo(f"{said[:1].upper()}{said[1:]}.", err=True)
    return parse_experiment(toml, name, has_data=True), (said, *ignored)


def _said_of_other_kinds(answered: "pd.DataFrame", newest: "pd.DataFrame") -> tuple[str, ...]:
    from analysis.read.pool import SERIES

    same_origin = answered["run_origin"].isin(newest["run_origin"])
    others = answered[same_origin & ~answered["trial_kind"].isin(newest["trial_kind"])]
    return tuple(
        f"answers of another kind of trial in data series {number} were ignored; to analyze them: --series "
        f"{number}"
        for number in sorted(set(others[SERIES]))
    )


def _definition_text(url: str, study: str, version: int, shipped: str) -> str:
    from analysis.read.database import stored_definition

    try:
        if toml := stored_definition(url, study, None, version):
            return toml
        why = "is not in the database"
    except InputError:
        # As where a user may read the answers alone.
        why = "cannot be read there"
    raise InputError(
        f"study '{study}' (version {version}) differs from the shipped {shipped}, and its definition {why}; "
        "give its TOML file instead"
    )


def _declared_experiment(
    name_or_path: str, database: str | None, study: str | None, pool: "Pool"
) -> tuple["Experiment", str | None]:
    """The experiment and the study to read: a shipped one, a file, or a study of the database, by name."""
    from experiments.load import UnknownExperimentError, load_experiment, parse_experiment

    try:
        return load_experiment(name_or_path, has_data=True), study
    except UnknownExperimentError as error:
        if "/" in name_or_path:
            raise
        if database is not None and study in (None, name_or_path):
            from analysis.read.database import stored_definition

            toml = stored_definition(database, name_or_path, pool.series, pool.version)
            if toml is not None:
                return parse_experiment(toml, name_or_path, has_data=True), name_or_path
        raise _no_such_study(name_or_path, database, error) from error


def _no_such_study(name: str, database: str | None, error: "UnknownExperimentError") -> InputError:
    """What to do about a name that is neither an experiment nor a study: a file, the database, a download."""
    if Path(f"{name}.toml").is_file():
        return InputError(
            f"no experiment '{name}'; there is a file {name}.toml here; to use it: analysis run {name}.toml"
        )
    # Its Design tab has the definition, and its Data tab the answers.
    elsewhere = f"{error.elsewhere}. With the CSV from its Data tab: analysis run {name}.toml --csv FILE"
    if database is None:
        return InputError(f"{error.said}. {elsewhere}")
    from analysis.read.database import said_of_studies
    from experiments.load import DEMOS, SHIPPED

    stored, is_all = said_of_studies(database, name, (*SHIPPED, *DEMOS))
    if is_all:
        return InputError(f"no experiment or study '{name}'; {stored}")
    return InputError(f"{error.said}. {stored}. {elsewhere}")
