"""`stimuli actor`."""

import typer


def register(app: typer.Typer) -> None:
    """Add the commands of the synthetic actor to `app`."""
