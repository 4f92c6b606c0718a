"""The command groups of blinks: `stimuli blinks`, `stimuli model` and `stimuli profiles`."""

import typer

from stimuli_builder.blinks.cli_blinks import register as register_blinks
from stimuli_builder.blinks.cli_model import register as register_model
from stimuli_builder.blinks.cli_profiles import register as register_profiles


def register(app: typer.Typer) -> None:
    """Add the three groups to `stimuli`."""
    register_blinks(app)
    register_profiles(app)
    register_model(app)
