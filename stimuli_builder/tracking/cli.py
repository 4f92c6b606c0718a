"""`stimuli track`, `stimuli train`, `stimuli label` and `stimuli accuracy`."""

import typer


def register(app: typer.Typer) -> None:
    """Add the commands of the tracker to `app`."""
