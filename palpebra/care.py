"""`palpebra doctor`, `backup` and `upgrade`: care for the installation and its data."""

import shutil
from datetime import UTC, datetime
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from experiments.command_line import EXTRAS, install_line
from experiments.errors import InputError
from experiments.files import existing_part
from palpebra.folders import Folder, data_folder, use_folder

UPGRADE = "uv tool install --force NEW.whl    (NEW.whl: the file of the new version)"


def register(parent: typer.Typer) -> None:
    """Add the commands."""
    parent.command("doctor")(doctor)
    parent.command("backup")(backup)
    parent.command("upgrade")(upgrade)


def doctor(folder: Folder = None) -> None:
    """Check the installation and the data, and say what to fix; exit code 1 if something failed.

    Example: palpebra doctor
    """
    typer.echo(f"Palpebra {metadata.version('palpebra')}, data folder {_used(folder)}")
    for extra, modules in EXTRAS.items():
        missing = [module for module in modules if find_spec(module) is None]
        said = "installed" if not missing else f"not installed: {install_line(extra)}"
        typer.echo(f"extra {extra}: {said}")
    from server.operations.cli import doctor as server_doctor

    server_doctor(as_json=False)


def backup(
    file: Annotated[
        Path | None, typer.Argument(help="File to write; backups/palpebra-DATE.tar in the data folder.")
    ] = None,
    folder: Folder = None,
) -> None:
    """Write database, clips and secret key into one file. The server may keep running.

    Examples:

        palpebra backup

        palpebra backup ~/palpebra-monday.tar
    """
    typer.echo(f"Backup: {_backed_up(_used(folder), file)}")


def upgrade(folder: Folder = None) -> None:
    """Back up the data and bring the database to this version. Prints the line that upgrades the program.

    Example: palpebra upgrade
    """
    from server.cli_common import migrated_services
    from server.core.migrate import current_revision, newest_revision

    place = _used(folder)
    if not (place / "palpebra.sqlite").exists():
        raise InputError(f"nothing to upgrade: {place} holds no database; `palpebra` creates one")
    kept = _backed_up(place, None)
    with migrated_services() as services:
        revision = current_revision(services.database)
    typer.echo(f"Backup: {kept}")
    typer.echo(f"Database: revision {revision} (newest: {newest_revision()})")
    typer.echo(f"To upgrade the program: {UPGRADE}")


def _used(folder: Path | None) -> Path:
    place = data_folder(folder)
    use_folder(place)
    return place


def _backed_up(place: Path, file: Path | None) -> Path:
    from server.operations.cli_backups import backup as server_backup

    if file is None:
        kept = place / "backups"
        kept.mkdir(exist_ok=True, mode=0o700)
        file = kept / f"palpebra-{datetime.now(UTC):%Y-%m-%dT%H%M%S}.tar"
    needed = sum(
        path.stat().st_size for path in place.rglob("*") if path.is_file() and "backups" not in path.parts
    )
    free = shutil.disk_usage(existing_part(file.resolve().parent)).free
    if free < needed:
        raise InputError(
            f"{file}: a backup needs {needed / 1e6:.0f} MB, but only {free / 1e6:.0f} MB are free"
        )
    server_backup(file, without_clips=False, keep=0, keys=None, to="", recipient="", replace=False)
    return file
