"""`server capsule`: everything of a study that can be handed on, in one zip that can be verified."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from experiments.files import check_targets
from server.accounts.audit import record
from server.accounts.identity import OPERATOR
from server.capsules.build import CapsuleContents, CapsuleOrigin, build_capsule
from server.cli_common import out, stored_services
from server.export.extract import Extract
from server.studies.lookup import find_study


def register(parent: typer.Typer) -> None:
    """Add `server capsule` to the command line."""
    parent.command("capsule")(capsule)


def capsule(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[Path, typer.Option("--out", help="Zip to write.")],
    origin: Annotated[CapsuleOrigin, typer.Option(help="Whose data.")] = "participant",
    series: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="One data series alone: its data, definition, clips and report. Without it the data of "
            "every series, and all else of the active version.",
        ),
    ] = None,
    clips: Annotated[
        bool, typer.Option(help="Put the clips in; without them the manifest has their hashes.")
    ] = True,
    sensitivity: Annotated[
        bool, typer.Option(help="Put in what takes long: mixed and ordinal models, Bayes factors.")
    ] = True,
) -> None:
    """Write the capsule of a study: a Psych-DS dataset and an RO-Crate with data, materials and report.

    The data are de-identified. Anybody can verify the capsule with `analysis verify`.

    Examples:

      server capsule exp3 --out exp3-capsule.zip

      server capsule exp3 --origin simulated --no-clips --out rehearsal.zip

      server capsule exp3 --series 2 --out exp3-series-2.zip

      analysis verify exp3-capsule.zip
    """
    check_targets([out_file])
    with stored_services() as services, Console(stderr=True, markup=False).status("capsule") as status:
        with services.database.write() as session:
            known = find_study(session, study, OPERATOR, "view")
            about = Extract(origin, series).definition(session, known).dataset
            record(session, None, "data downloaded", "study", study, what="capsule", origin=origin)
        made = build_capsule(
            services,
            study,
            CapsuleContents(origin, clips, sensitivity, series),
            out_file,
            lambda _, step: status.update(Text(f"capsule: {step}")),
        )
    out.print(f"{out_file}: {out_file.stat().st_size:,} bytes, {len(made.files)} files, sha256 {made.sha256}")
    missing = [
        name for name, value in (("creators", about.creators), ("licence", about.licence)) if not value
    ]
    if missing:
        typer.echo(f"no {' and no '.join(missing)} declared: say them in the table [dataset]", err=True)
