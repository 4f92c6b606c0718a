"""The three programs in the list of commands; `palpebra.cli` calls them before this is reached."""

import typer


def register(parent: typer.Typer) -> None:
    """Add the names, so that `palpebra --help` lists them."""
    for name in ("stimuli", "server", "analysis"):
        parent.command(name)(_listed)


def _listed() -> None:
    """See `palpebra stimuli --help`, `palpebra server --help` and `palpebra analysis --help`."""
