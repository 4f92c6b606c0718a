"""`stimuli scope`: what a phone's film or a photodiode says of the frames on the screen."""

from pathlib import Path
from typing import Annotated

import typer

HELP = """
Read the sync patch from a film of the screen or a photodiode: missing frames and intervals.

Declare `sync_patch = true` in `[display]`, start a run, and film the patch (lower left corner of the clip)
at 240 frames per second, with the phone on a stand, from before the start key until after the clip. One film
may have several clips. A file ending in .csv is a photodiode's trace over the middle field: time_ms, value.

Examples:

  stimuli scope clip.mp4

  stimuli scope slow_motion.mov --camera-fps 240 --frames 60 --out onsets.csv

  stimuli scope diode.csv --fps 30
"""


def scope(
    film: Annotated[
        Path,
        typer.Argument(
            metavar="video", help="Film of the patch, or CSV of a photodiode.", show_default=False
        ),
    ],
    camera_fps: Annotated[
        float | None,
        typer.Option(min=1, help="Frames per second of the recording, if the file plays in slow motion."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(min=1, help=("Frames per second of the clip. Default: estimated from the film.")),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(min=1, help=("Number of frames of the clip. Default: up to the last one detected.")),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write each onset to this CSV.")] = None,
) -> None:
    """Read a film of the sync patch."""
    from stimuli_builder.sync_patch import onsets

    if film.suffix.lower() == ".csv":
        lines, rows = _of_trace(film, fps)
    else:
        lines, rows = _of_film(film, camera_fps, fps, frames)
    print("\n".join(lines))
    if out:
        onsets.write_csv(out, rows)
        print(f"wrote {out}")


Said = tuple[list[str], list[tuple[object, ...]]]


def _of_film(path: Path, camera_fps: float | None, fps: float | None, frames: int | None) -> Said:
    from stimuli_builder.sync_patch import onsets
    from stimuli_builder.sync_patch.film import read_film
    from stimuli_builder.sync_patch.onsets import plays

    read = read_film(path, camera_fps, lambda line: typer.echo(line, err=True))
    shown = plays(read.times_ms, read.numbers, fps, frames)
    return onsets.of_film(shown, read.pictures_per_s), onsets.rows_of_film(shown)


def _of_trace(path: Path, fps: float | None) -> Said:
    from experiments.errors import InputError
    from stimuli_builder.sync_patch import onsets

    if fps is None:
        raise InputError("a photodiode's trace needs the clip's rate: add, for example, --fps 30")
    changes = onsets.changes(onsets.read_trace(path), fps)
    return onsets.of_trace(changes), onsets.rows_of_trace(changes)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("scope", help=HELP)(scope)
