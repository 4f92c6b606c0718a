"""`server person`: what is stored of one person, and its erasure."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.command_groups import command_group
from experiments.errors import InputError
from experiments.files import check_targets, whole_private_file
from server.accounts.identity import OPERATOR
from server.cli_common import out, stored_services
from server.persons.service import subject_access, visits_of
from server.runs.erasure import erase
from server.studies.lookup import find_study

app = command_group("One participant: subject access and erasure.")
StudyName = Annotated[str, typer.Argument(help="Name of the study.", show_default=False)]
Run = Annotated[str, typer.Option("--run", help="Identifier of one of the person's runs.")]
RecruitersId = Annotated[str, typer.Option("--id", help="What the recruiter calls the person.")]


def register(parent: typer.Typer) -> None:
    """Add `server person` to the command line."""
    parent.add_typer(app, name="person")


@app.command("export")
def export(
    study: StudyName,
    file: Annotated[Path, typer.Option("--out", help="JSON file to write, mode 600.", show_default=False)],
    run: Run = "",
    identifier: RecruitersId = "",
) -> None:
    """Write everything that is stored of one person (a request for access under data protection law).

    In all visits to the study that are known to be hers, table by table; the audit log tells of it.

    Examples:

      server person export exp3 --id 5a9d0c2f --out person.json

      server person export exp3 --run 0123456789abcdef --out person.json
    """
    _one_of_both(run, identifier)
    check_targets([file])
    with stored_services() as services, services.database.write() as session:
        known = find_study(session, study, OPERATOR, "own")
        visits = visits_of(session, known, run, identifier)
        told = subject_access(session, known, visits, OPERATOR)
    with whole_private_file(file) as stream:
        stream.write(told.encode())
    out.print(f"{file}: {len(visits)} visits")


@app.command("erase")
def erase_person(
    study: StudyName,
    run: Run = "",
    identifier: RecruitersId = "",
    confirmed: Annotated[bool, typer.Option("--yes", help="Erase without asking.")] = False,
) -> None:
    """Erase everything that is stored of one person, in all visits known to be hers; for good.

    Examples:

      server person erase exp3 --id 5a9d0c2f

      server person erase exp3 --run 0123456789abcdef --yes
    """
    _one_of_both(run, identifier)
    with stored_services() as services:
        with services.database.read() as session:
            known = find_study(session, study, OPERATOR, "edit")
            visits = [visit.public_id for visit in visits_of(session, known, run, identifier)]
        if not confirmed:
            typer.confirm(f"Erase {', '.join(visits)} of {study}, answers and all?", abort=True)
        with services.database.write() as session:
            known = find_study(session, study, OPERATOR, "edit")
            erased = erase(session, services.settings, known, visits[0], visits[0], OPERATOR)
    out.print(f"erased: {', '.join(erased.runs)}; keep the ledger {erased.ledger}")
    for report in erased.reports:
        out.print(f"made before and still with her data under the pseudonym: report {report.report}")


def _one_of_both(run: str, identifier: str) -> None:
    if bool(run) == bool(identifier):
        raise InputError("expected either --run (the run's identifier) or --id (the recruiter's id)")
