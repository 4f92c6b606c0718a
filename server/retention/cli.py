"""`server retention`: what the declared periods erase, and its erasure."""

from typing import Annotated

import typer

from server.accounts.identity import OPERATOR
from server.cli_common import out, stored_services
from server.clock import now
from server.context import Services
from server.retention import service
from server.retention.schemas import RetentionPreview
from server.studies.lookup import find_study


def register(parent: typer.Typer) -> None:
    """Add `server retention` to the command line."""
    parent.command("retention")(retention)


def retention(
    study: Annotated[
        str | None, typer.Argument(help="Name of the study; every study that declares a period if not given.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what is due and when more will be; erase nothing.")
    ] = False,
) -> None:
    """Erase what is due by the retention that studies declare; the server does so each hour.

    Erased visits are in the ledger of erasures, so that no restore brings them back, and in the audit log.

    Examples:

      server retention --dry-run

      server retention exp3
    """
    with stored_services() as services:
        shown = _previews(services, study)
        if not shown:
            out.print("no study declares a period; see [retention] of the declaration")
        elif dry_run:
            for preview in shown:
                out.print(_line(preview), soft_wrap=True)
        else:
            for name in (preview.study for preview in shown):
                done = service.carry_out(services.database, services.settings, name)
                out.print(f"{name}: identifiers of {done.identifiers} visits, {done.visits} visits erased")


def _previews(services: Services, study: str | None) -> list[RetentionPreview]:
    with services.database.read() as session:
        names = service.names(session) if study is None else [study]
        known = [find_study(session, name, OPERATOR, "view") for name in names]
        return [service.preview(session, one, now()) for one in known]


def _line(preview: RetentionPreview) -> str:
    periods = ", ".join(f"{period.what} {period.days} days" for period in preview.periods) or "no periods"
    following = f"{preview.next_at:%Y-%m-%d %H:%M} UTC" if preview.next_at else "none"
    due = (
        f"due are identifiers of {preview.identifiers} visits and {preview.visits} visits; next: {following}"
    )
    return f"{preview.study}: {periods}; {due}"
