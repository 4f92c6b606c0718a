"""Where data are kept, and which port is free: decided once, before the server reads its settings."""

import os
from pathlib import Path
from typing import Annotated

import typer
from platformdirs import user_data_path

from experiments.errors import InputError

DATA_VARIABLE = "PALPEBRA_DATA_FOLDER"
PORT = 8000
PORTS_TRIED = 20
Folder = Annotated[Path | None, typer.Option(help="Folder of the data; your user data folder by default.")]
"""The option `--folder`."""


def default_folder() -> Path:
    """The user's data folder on this system."""
    return user_data_path("palpebra", appauthor=False)


def data_folder(given: Path | None) -> Path:
    """The folder of the data, made if it is missing.

    Parameters
    ----------
    given : Path or None
        `--folder`; else the environment variable PALPEBRA_DATA_FOLDER, else the user's data folder of this
        system (`~/.local/share/palpebra` on Linux).

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    folder = given or Path(os.environ.get(DATA_VARIABLE) or default_folder())
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        probe = folder / ".can_be_written"
        probe.touch()
        probe.unlink()
    except OSError as error:
        is_file = folder.exists() and not folder.is_dir()
        reason = "a file" if is_file else f"'{error.strerror or error}'"
        raise InputError(
            f"folder {folder}: expected a writable folder, got {reason}; choose another by --folder"
        ) from error
    return folder.resolve()


def free_port(wanted: int | None) -> int:
    """The port to listen on: the wanted one, or the first free one from 8000 on.

    Raises
    ------
    InputError
        The wanted port is in use, or none of the next ones is free.
    """
    from server.cli_run import why_not_free  # slow to import: only where a server starts

    ports = [wanted] if wanted else range(PORT, PORT + PORTS_TRIED)
    for port in ports:
        if why_not_free("127.0.0.1", port) is None:
            return port
    tried = f"port {wanted} is" if wanted else f"ports {PORT} to {PORT + PORTS_TRIED - 1} are"
    raise InputError(f"{tried} in use; choose a free one by --port")


def use_folder(folder: Path) -> None:
    """Set the environment that the server reads its settings from."""
    os.environ[DATA_VARIABLE] = str(folder)
