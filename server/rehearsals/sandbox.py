"""The rehearsal itself, in a separate process and database, with the power of the declared plan."""

import json
import secrets
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from experiments.assignment.groups import names
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds import KINDS, expected_minutes
from experiments.manifest import Manifest
from server.accounts.identity import OPERATOR
from server.app import create_app
from server.cli_common import migrated_services
from server.core.db import Database
from server.core.locks import LONGEST_S
from server.core.settings import Settings
from server.exports.csv_lines import csv_pieces, rating_table
from server.exports.formats import runs_csv
from server.exports.schemas import Extract
from server.exports.tables import answers_table, runs_table
from server.models import Study
from server.rehearsals.http import JsonClient, RefusedRequest, running_server
from server.rehearsals.person import Person, link_and_raters
from server.rehearsals.schemas import (
    DEFINITION,
    MANIFEST,
    ORDER,
    REPORT,
    RESULT,
    Order,
    Power,
    RehearsalResult,
    RehearsedColumn,
    RehearsedPerson,
    RehearsedTrial,
    Step,
    example_of,
)
from server.results import replay_repository
from server.results.jobs import run_analysis
from server.studies.creation import add_version, create_study, planned_experiment
from server.studies.lookup import find_study

# The rehearsal itself, in a separate process and database: it does not know where people's data are.

SIMULATIONS = 200
"""Data sets that a plan of power draws."""
SHOWN_PEOPLE = 5
Say = Callable[[float, str], None]


def rehearse(folder: Path, say: Say) -> None:
    """Simulate people in a sandbox and write what it showed into `folder`.

    Parameters
    ----------
    folder : Path
        Holds definition, manifest and order; gets `rehearsal.json` and the report.
    say : callable
        Gets the share that is done, and what is done next.
    """
    order = Order.model_validate_json((folder / ORDER).read_text(encoding="utf-8"))
    text = (folder / DEFINITION).read_text(encoding="utf-8")
    experiment = planned_experiment(text)
    settings = Settings(
        data_folder=folder / "sandbox", database_url="", s3_bucket="", secret_key=secrets.token_hex(32)
    )
    say(0.02, "setting up the sandbox")
    with migrated_services(settings) as services:
        manifest = Manifest.model_validate_json((folder / MANIFEST).read_text(encoding="utf-8"))
        _take_in(services.database, text, experiment, manifest)
        groups = names(experiment) if experiment.groups.by == "link" else [""]
        invited = [
            link_and_raters(
                services.database, services.settings, services.versions, experiment.name, group=group
            )
            for group in groups
        ]
    with running_server(create_app(settings)) as address:
        for number in range(order.participants):
            say(0.05 + 0.5 * number / order.participants, f"person {number + 1} of {order.participants}")
            token, raters = invited[number % len(invited)]
            _take_part(address, token, raters(order.seed * 1_000_000 + number, order.seed))
    with migrated_services(settings) as services:
        say(0.55, "reading the data")
        with services.database.read() as session:
            study = find_study(session, experiment.name, OPERATOR, "view")
            result = _rehearsal_result(session, study, experiment, order)
            _export(session, study, folder)
    say(0.6, "making the report")
    report = folder / REPORT
    result.report_problem = run_analysis(
        folder / DEFINITION,
        folder / "answers.csv",
        report,
        origin="simulated",
        series=1,
        sensitivity=False,
        runs=folder / "runs.csv",
    )
    result.report = sorted(path.name for path in report.iterdir()) if report.is_dir() else []
    say(0.85, "computing the power")
    result.power, result.power_problem = _power(experiment, folder, order.seed)
    (folder / RESULT).write_text(result.model_dump_json(indent=1), encoding="utf-8")


def _take_in(database: Database, text: str, experiment: Experiment, manifest: Manifest) -> None:
    with database.write() as session:
        study = create_study(session, experiment.name, experiment, None)
        add_version(session, study, text, experiment, manifest, None)
        study.status = "live"


def _take_part(address: str, token: str, rater: Any) -> None:
    client = JsonClient(address)
    try:
        Person(client, rater).take_part(token)
    except RefusedRequest as error:
        raise InputError(f"the server refused a simulated person: {error}") from error
    finally:
        client.close()


def _rehearsal_result(
    session: Session, study: Study, experiment: Experiment, order: Order
) -> RehearsalResult:
    runs = replay_repository.runs_of_study(session, study)
    people = [
        RehearsedPerson(
            number=number,
            group=run.group_name,
            status=run.status,
            minutes=round(run.elapsed_ms / 60_000, 1),
            trials=_trials(session, run.id),
        )
        for number, run in enumerate(runs[:SHOWN_PEOPLE], 1)
    ]
    return RehearsalResult(
        participants=order.participants,
        complete=sum(run.status == "complete" for run in runs),
        answers=replay_repository.number_of_answers(session, study),
        expected_minutes=expected_minutes(experiment),
        people=people,
        columns=_columns(session, study),
        report=[],
        report_problem="",
        power=None,
        power_problem="",
    )


def _trials(session: Session, run: int) -> list[RehearsedTrial]:
    trials: list[RehearsedTrial] = []
    for index, kind, block, cell, exemplar in replay_repository.trials_of_run(session, run):
        if not trials or trials[-1].trial_index != index:
            trials.append(RehearsedTrial(trial_index=index, kind=kind, block=block, clips=[]))
        if cell is not None:
            trials[-1].clips.append(f"{cell} {exemplar}")
    return trials


def _columns(session: Session, study: Study) -> list[RehearsedColumn]:
    """Every column of both tables, with the first value that anybody left in it."""
    columns = []
    for make in (answers_table, runs_table):
        table = make(session, study, Extract("simulated"))
        rows: Sequence[Sequence[Any]] = list(table.rows)
        for index, column in enumerate(table.columns):
            value = next((row[index] for row in rows if row[index] not in (None, "")), None)
            columns.append(
                RehearsedColumn(
                    table=table.name,
                    name=column.name,
                    type=column.type,
                    meaning=column.description,
                    example=example_of(value),
                )
            )
    return columns


def _export(session: Session, study: Study, folder: Path) -> None:
    with (folder / "answers.csv").open("wb") as stream:
        stream.writelines(csv_pieces(rating_table(session, study, Extract("simulated"))))
    with (folder / "runs.csv").open("wb") as stream:
        stream.writelines(runs_csv(session, study, Extract("simulated")))


def _power(experiment: Experiment, folder: Path, seed: int) -> tuple[Power | None, str]:
    """What `analysis plan` says; or why it says nothing."""
    try:
        arguments, assumed = KINDS[experiment.trial.kind].power(experiment)
    except InputError as error:
        return None, str(error)
    out = folder / "power.json"
    program = str(Path(sys.executable).with_name("analysis"))
    further = ["--simulations", str(SIMULATIONS), "--seed", str(seed)]
    done = subprocess.run(  # noqa: S603 - the program beside this interpreter, arguments of numbers and names
        [program, *arguments, *further, "--json", str(out)],
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    if done.returncode:
        lines = [line for line in (done.stderr or done.stdout).splitlines() if line.strip()]
        return None, lines[-1][:500] if lines else "the power could not be computed"
    said = json.loads(out.read_text(encoding="utf-8"))
    command = " ".join(["analysis", *arguments, *further])
    known = {name: said[name] for name in ("n", "effects", "power", "text")}
    return Power(assumed=assumed, command=command, **known), ""


def main() -> None:
    """`python -m server.rehearsals.sandbox FOLDER`: rehearse, with JSON lines on stdout."""

    def say(share: float, step: str) -> None:
        print(Step(share=share, step=step).model_dump_json(), flush=True)  # noqa: T201

    try:
        rehearse(Path(sys.argv[1]), say)
    except (InputError, OSError, subprocess.SubprocessError) as error:
        print(Step(problem=str(error)[:500]).model_dump_json(), flush=True)  # noqa: T201
        sys.exit(1)


if __name__ == "__main__":
    main()
