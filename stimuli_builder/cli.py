"""The command `stimuli`: it only gathers the command groups, each of which lives with its subject."""

import typer

from experiments.command_line import run_command_line

app = typer.Typer(
    name="stimuli",
    help="From a recorded face to rated clips: track eyelids, measure blinks, build stimuli.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def _gather() -> None:
    from stimuli_builder.actor.cli import register as register_actor
    from stimuli_builder.blinks.cli import register as register_blinks
    from stimuli_builder.characters.cli import register as register_characters
    from stimuli_builder.clips.cli import register as register_clips
    from stimuli_builder.tracking.cli import register as register_tracking

    register_actor(app)
    register_tracking(app)
    register_blinks(app)
    register_characters(app)
    register_clips(app)


_gather()


def main() -> None:
    """Run `stimuli`; bad input ends in one line on stderr and exit code 2."""
    run_command_line(app)
