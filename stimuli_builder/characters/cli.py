"""`stimuli bake` and `stimuli character`: render or record one, list those installed, restore an old one."""

from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Any

import typer

from experiments.command_groups import command_group
from experiments.errors import InputError, counted
from stimuli_builder.characters.atlas import load_retired, restore
from stimuli_builder.clips.characters import SHIPPED_FOLDER, geometry, shipped_names

BAKERS = "palpebra.bakers"
"""Entry points by which a separate package adds a command to `stimuli bake`."""
KNOWN_BAKERS = {
    "face": "A character on face-kit geometry.",
    "samples": "Synthetic training data for eyelid detectors.",
}

bake_app = command_group("Render a character's atlas of baked pictures.")
character_app = command_group("List the installed characters, and restore a character of an earlier release.")


@bake_app.callback()
def _bake() -> None:
    """Render a character's atlas of baked pictures."""


@character_app.command("list")
def list_characters(
    every: Annotated[
        bool, typer.Option("--all", help="Also list the characters of earlier releases, with their origin.")
    ] = False,
) -> None:
    """List the installed characters, and count those of earlier releases.

    Examples:

      stimuli character list

      stimuli character list --all
    """
    names = shipped_names()
    for name in names:
        shape = geometry(name)
        lower = "its lower lid moves" if shape.lower_range_mm else "no separate lower lid"
        typer.echo(
            f"{name:16} {shape.size_px[0]} x {shape.size_px[1]} px, opens {shape.opening_mm:g} mm, {lower}"
        )
    earlier = {name: retired for name, retired in load_retired().items() if name not in names}
    if every:
        for name, retired in earlier.items():
            typer.echo(f"{name:16} not installed ({retired.label})")
    if earlier:
        listed = "" if every else "; `stimuli character list --all` lists them"
        typer.echo(
            f"{counted(len(earlier), 'character')} of earlier releases can be restored: "
            f"`stimuli character fetch NAME`{listed}"
        )


@character_app.command("fetch")
def fetch_character(
    name: Annotated[str, typer.Argument(help="Character of an earlier release.")],
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help=(
                "Clone of Palpebra, an earlier release (its .whl, .tar.gz or .zip, or unpacked), or the "
                "character's folder [default: this clone]."
            ),
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for it [default: next to the shipped characters].")
    ] = None,
) -> None:
    """Restore a character of an earlier release, byte for byte, so that its studies render as before.

    Nothing is downloaded: its pictures come from the history of your clone, or from an earlier release.

    Examples:

      stimuli character fetch photorealistic

      stimuli character fetch photorealistic --from ~/Downloads/palpebra-2026-11 --out my/photorealistic

      stimuli character fetch photorealistic --from palpebra-0.1.0-py3-none-any.whl --out my/photorealistic
    """
    target = out or SHIPPED_FOLDER / name
    typer.echo(f"'{name}' is in {restore(name, source, target)}")


@bake_app.command("recording")
def bake_recording_command(
    video: Annotated[
        Path, typer.Argument(help="Video of a person who blinks, best at 240 frames per second.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of the character; its name is the character's.")],
    track: Annotated[
        Path | None, typer.Argument(help="Track of VIDEO [default: it is tracked without labels].")
    ] = None,
    one_eye: Annotated[bool, typer.Option("--one-eye", help="Close-up of one eye.")] = False,
    eye_distance_mm: Annotated[
        float,
        typer.Option(
            min=40,
            max=80,
            help="Distance between the person's eyes; it sets the scale of two-eye recordings.",
        ),
    ] = 60.0,
    label: Annotated[str, typer.Option(help="Words that describe the character.")] = "",
    accept_variable_rate: Annotated[
        bool, typer.Option("--accept-variable-rate", help="Accept a variable frame rate.")
    ] = False,
) -> None:
    """Make a character from a person's own video: its levels are recorded frames, and pictures between them.

    The levels come from the opening of one blink. Head motion and changes of light are removed, frames are
    chosen by closure and gaze, and the tracker measures the opening of every level. The folder also gets
    report.html: what is recorded, what is interpolated and how well, and what to record again.
    Ask the person shown for consent first (docs/how-to/record-a-character.md has a form).

    Examples:

      stimuli bake recording me.mp4 --out characters/me

      stimuli bake recording eye.mp4 eye_track.csv --one-eye --out characters/eye
    """
    from stimuli_builder.characters.recording_bake import RecordingOrder, bake_recording, summary_lines

    order = RecordingOrder(video, out, track, one_eye, eye_distance_mm, label, accept_variable_rate)
    for line in summary_lines(bake_recording(order), order):
        typer.echo(line)


ANY_OPTIONS: dict[str, Any] = {"ignore_unknown_options": True, "allow_extra_args": True}


def _not_installed(name: str) -> Callable[[typer.Context], None]:
    """A command that says how to install what it needs."""

    def command(context: typer.Context) -> None:
        del context
        raise InputError(
            f"`stimuli bake {name}` needs the package palpebra-face-baking, which is not installed; "
            "in a clone of the repository run: python -m pip install --no-deps -e packages/face_baking"
        )

    return command


def register(app: typer.Typer) -> None:
    """Add `bake` and `character` to the command line."""
    installed = {baker.name: baker for baker in entry_points(group=BAKERS)}
    for name, summary in KNOWN_BAKERS.items():
        if name in installed:
            bake_app.command(name)(installed[name].load())
        else:
            bake_app.command(name, help=summary, context_settings=ANY_OPTIONS)(_not_installed(name))
    app.add_typer(bake_app, name="bake")
    app.add_typer(character_app, name="character")
