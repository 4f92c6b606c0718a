"""`stimuli profiles`: the shipped library of blink profiles, and how it is measured anew."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.command_line import command_group

LIBRARY_HELP = """
The blink profiles that ship with the project.

Examples:

  stimuli profiles list

  stimuli profiles plot library.png

  stimuli profiles build --data ../shared/data/blink_series --out library/
"""


def register(app: typer.Typer) -> None:
    """Add `stimuli profiles` to `app`."""
    profiles = command_group(LIBRARY_HELP, no_args_is_help=False)
    profiles.callback(invoke_without_command=True)(_list_by_default)
    profiles.command("list")(list_profiles)
    profiles.command("plot")(plot_profiles)
    profiles.command("build")(build_library)
    app.add_typer(profiles, name="profiles")


def _list_by_default(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        list_profiles()


def list_profiles() -> None:
    """List the shipped profiles.

    Example: stimuli profiles list
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from stimuli_builder.blinks.library import load_library

    shipped = load_library()
    table = Table("profile", "eye", "down", "up", "at 30 fps", "closure", "recording", box=SIMPLE_HEAD)
    for profile in shipped:
        lengths = [str(profile.down_frames), str(profile.up_frames), f"{profile.duration_frames_30fps:.1f}"]
        closure = f"{profile.closure.max():.2f}"
        table.add_row(profile.profile_id, profile.eye or "", *lengths, closure, profile.recording)
    console = Console(markup=False)
    console.print(table)
    pairs = len(load_library(paired=True))
    console.print(
        f"{len(shipped)} eye profiles; {pairs} blinks seen in both eyes; phases in frames at 300 fps"
    )


def plot_profiles(
    figure: Annotated[Path, typer.Argument(help="Figure to write (PNG, SVG, PDF).")],
) -> None:
    """Draw the library: aligned blinks with their mean, durations, amplitudes; a row a recording.

    Example: stimuli profiles plot library.png
    """
    from stimuli_builder.blinks.library import load_library
    from stimuli_builder.blinks.plots import aligned_figure, save_figure

    shipped = load_library()
    names = dict.fromkeys(profile.recording for profile in shipped)
    save_figure(aligned_figure({name: [p for p in shipped if p.recording == name] for name in names}), figure)
    typer.echo(f"wrote {figure}")


def build_library(
    data: Annotated[Path, typer.Option(help="Folder with the recordings' series.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; the shipped library's without it.")
    ] = None,
    recordings: Annotated[
        Path | None, typer.Option(help="List of recordings (TOML); the shipped one without it.")
    ] = None,
    components: Annotated[int, typer.Option(help="Components of the model.")] = 5,
) -> None:
    """Measure the library anew: profiles.csv, closures.csv and the model fitted to them, model.json.

    Example: stimuli profiles build --data recordings --out library
    """
    from experiments.errors import InputError
    from stimuli_builder.blinks.library.build import recorded_profiles, write_model, write_profiles
    from stimuli_builder.blinks.library.recordings import LIBRARY_FOLDER, RECORDINGS_FILE, read_recordings

    folder = out or LIBRARY_FOLDER
    if not folder.is_dir():
        raise InputError(f"{folder}: the folder does not exist; make it first")
    entries = read_recordings(recordings or RECORDINGS_FILE)
    measured = [profile for entry in entries for profile in recorded_profiles(entry, data)]
    write_profiles(folder, measured, entries)
    model = write_model(folder, measured, components)
    eye = sum(profile.closure_other is None for profile in measured)
    typer.echo(
        f"{eye} eye profiles and {len(measured) - eye} pairs from {len(entries)} recordings -> {folder}"
    )
    typer.echo(f"model: {components} components keep {model.variance_kept:.1%} of the variance")
