"""`analysis verify`: is a capsule whole, and does its report come out again?"""

from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.commands.output import saying

if TYPE_CHECKING:
    from analysis.capsule.compare import Compared
    from experiments.capsule.declaration import Capsule


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="verify")(verify)


def verify(
    capsule: Annotated[
        Path, typer.Argument(help="The zip of a capsule, or the folder it was unpacked into.")
    ],
    report: Annotated[
        bool, typer.Option(help="Make the report again, or only compare every file with its hash.")
    ] = True,
) -> None:
    """Verify a capsule: every file is as listed, and the report comes out again from the data in it.

    Every table is rebuilt as printed, and under the same versions every figure byte for byte. What differs is
    named, with the versions that differ, and numbers that a later release changed on purpose with the reason.
    Ends with code 0 where all is well, or only figures differ under
    other versions; 1 where the report differs; 2 where a file was changed, is missing or foreign.

    Examples:

      analysis verify exp3-capsule.zip

      analysis verify exp3-capsule.zip --no-report
    """
    from experiments.capsule.declaration import REPORT_FOLDER
    from experiments.capsule.opening import open_capsule
    from experiments.software import differences, present_software

    with TemporaryDirectory(prefix="capsule-") as temporary, saying("verifying") as say:
        files, work = Path(temporary) / "files", Path(temporary) / "work"
        files.mkdir()
        work.mkdir()
        say("hashes")
        listed, folder = open_capsule(capsule, files)
        typer.echo(f"capsule of the study {listed.study}, made {listed.made}, sha256 {listed.sha256}")
        typer.echo(f"{len(listed.files)} files, every one as listed")
        if not report:
            return
        from analysis.capsule.compare import compare_reports
        from analysis.capsule.rebuild import rebuild

        again = rebuild(listed.report, folder, work, say)
        made = date.fromisoformat(listed.made[:10])
        compared = compare_reports(listed.report.rebuilt, folder / REPORT_FOLDER, again, made)
        _check_software(listed, folder)
    versions = differences(listed.software, present_software())
    _tell(compared, versions)


def _check_software(listed: "Capsule", folder: Path) -> None:
    """The versions of the list are those of the capsule's other file of them; else one was changed alone."""
    import json

    from experiments.capsule.declaration import SOFTWARE_FILE
    from experiments.errors import InputError

    path = folder / SOFTWARE_FILE
    if not path.is_file() or json.loads(path.read_text(encoding="utf-8")) != listed.software.model_dump(
        mode="json"
    ):
        raise InputError(
            f"{SOFTWARE_FILE}: expected the versions that the list names, got others; nothing says by which "
            "versions the report was made"
        )


def _tell(compared: "list[Compared]", versions: list[str]) -> None:
    """Say what differs; exit code 1 where a table does, or a figure under the same versions."""
    same = sum(one.kind == "same" for one in compared)
    typer.echo(f"the report made again: {same} of {len(compared)} files are the same byte for byte")
    for one in compared:
        if one.kind != "same":
            typer.echo(f"{one.name}: {one.said}")
    if same == len(compared):
        typer.echo("verified: every table as printed, every figure byte for byte")
        return
    said = "; ".join(versions) or "none: the software is the same"
    typer.echo(f"versions that differ, by what the capsule says of itself: {said}")
    if any(one.kind == "table" for one in compared):
        typer.echo("NOT verified: tables differ", err=True)
        raise typer.Exit(1)
    if any(one.kind == "figure" for one in compared) and not versions:
        typer.echo("NOT verified: figures differ under the same versions", err=True)
        raise typer.Exit(1)
    typer.echo("verified: every table as printed; what differs is due to other versions or processors")
