"""`server person` and `server retention`."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.command_groups import command_group
from experiments.errors import InputError
from experiments.files import check_targets, whole_private_file
from server.accounts.identity import OPERATOR
from server.cli_common import out, stored_services
from server.core.db import Database
from server.core.values import now
from server.privacy import retention as retention_service
from server.privacy.erasures import erase
from server.privacy.persons import subject_access, visits_of
from server.privacy.retention import RetentionPreview
from server.studies.lookup import find_study

# `server person`: what is stored of one person, and its erasure.

app = command_group("One participant: subject access and erasure.")
StudyName = Annotated[str, typer.Argument(help="Name of the study.", show_default=False)]
Run = Annotated[str, typer.Option("--run", help="Identifier of one of the person's runs.")]
RecruitersId = Annotated[str, typer.Option("--id", help="ID of the person at the recruiter.")]


def register(parent: typer.Typer) -> None:
    """Add `server person` and `server retention` to the command line."""
    _register_persons(parent)
    _register_retention(parent)


def _register_persons(parent: typer.Typer) -> None:
    """Add `server person` to the command line."""
    parent.add_typer(app, name="person")


@app.command("export")
def export(
    study: StudyName,
    file: Annotated[Path, typer.Option("--out", help="JSON file to write, mode 600.", show_default=False)],
    run: Run = "",
    identifier: RecruitersId = "",
) -> None:
    """Write all stored data of one person (a request for access under data protection law).

    The file has every visit known to be theirs, table by table. The audit log records the request.

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
    confirmed: Annotated[bool, typer.Option("--yes", help="Erase without confirmation.")] = False,
) -> None:
    """Erase all stored data of one person permanently, in all visits known to be theirs.

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
        out.print(f"made earlier and still contains these data under the pseudonym: report {report.report}")


def _one_of_both(run: str, identifier: str) -> None:
    if bool(run) == bool(identifier):
        raise InputError("expected either --run (the run's identifier) or --id (the recruiter's ID)")


# `server retention`: what the declared periods erase, and its erasure.


def _register_retention(parent: typer.Typer) -> None:
    """Add `server retention` to the command line."""
    parent.command("retention")(retention)


def retention(
    study: Annotated[
        str | None, typer.Argument(help="Name of the study; by default, every study that declares a period.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what is due now and next; erase nothing.")
    ] = False,
) -> None:
    """Erase data that are due by the retention rules of studies; the server does so every hour.

    Erased visits are in the ledger of erasures, so that no restore brings them back, and in the audit log.

    Examples:

      server retention --dry-run

      server retention exp3
    """
    with stored_services() as services:
        shown = _previews(services.database, study)
        if not shown:
            out.print("no study declares a retention period; see [retention] in the declaration")
        elif dry_run:
            for preview in shown:
                out.print(_line(preview), soft_wrap=True)
        else:
            for name in (preview.study for preview in shown):
                done = retention_service.carry_out(services.database, services.settings, name)
                out.print(f"{name}: identifiers of {done.identifiers} visits, {done.visits} visits erased")


def _previews(database: Database, study: str | None) -> list[RetentionPreview]:
    with database.read() as session:
        names = retention_service.studies_with_period(session) if study is None else [study]
        known = [find_study(session, name, OPERATOR, "view") for name in names]
        return [retention_service.preview(session, one, now()) for one in known]


def _line(preview: RetentionPreview) -> str:
    periods = ", ".join(f"{period.what} {period.days} days" for period in preview.periods) or "no periods"
    following = f"{preview.next_at:%Y-%m-%d %H:%M} UTC" if preview.next_at else "none"
    due = (
        f"due now: identifiers of {preview.identifiers} visits and {preview.visits} visits; next: {following}"
    )
    return f"{preview.study}: {periods}; {due}"
