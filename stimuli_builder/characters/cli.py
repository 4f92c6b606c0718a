"""`stimuli bake` and `stimuli character`: render one, list those that are here, bring back an old one."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.command_line import command_group
from stimuli_builder.characters.cli_face import bake_face
from stimuli_builder.characters.cli_samples import bake_samples
from stimuli_builder.characters.retired import load_retired, restore
from stimuli_builder.clips.characters import SHIPPED_FOLDER, geometry, shipped_names

bake_app = command_group("Render a character's atlas of baked pictures.")
character_app = command_group("List the characters that are here, and bring back one of an earlier release.")


@bake_app.callback()
def _bake() -> None:
    """Render a character's atlas of baked pictures."""


@character_app.command("list")
def list_characters() -> None:
    """List the characters that are here, and those that earlier releases had.

    Examples:

      stimuli character list
    """
    names = shipped_names()
    for name in names:
        shape = geometry(name)
        lower = "its lower lid moves" if shape.lower_range_mm else "no lower lid of its own"
        typer.echo(
            f"{name:16} {shape.size_px[0]} x {shape.size_px[1]} px, opens {shape.opening_mm:g} mm, {lower}"
        )
    for name, retired in load_retired().items():
        if name not in names:
            typer.echo(f"{name:16} not here: `stimuli character fetch {name}` ({retired.label})")


@character_app.command("fetch")
def fetch_character(
    name: Annotated[str, typer.Argument(help="Character of an earlier release.")],
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Clone of Palpebra, an earlier release unpacked, or the character's folder [this clone].",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to hold it [beside the characters that ship].")
    ] = None,
) -> None:
    """Bring back a character of an earlier release, byte for byte, so that its studies render as they did.

    Nothing is downloaded: its pictures come from the history of your clone, or from an earlier release.

    Examples:

      stimuli character fetch photorealistic

      stimuli character fetch photorealistic --from ~/Downloads/palpebra-2026-11 --out my/photorealistic
    """
    target = out or SHIPPED_FOLDER / name
    typer.echo(f"'{name}' is in {restore(name, source, target)}")


def register(app: typer.Typer) -> None:
    """Add `bake` and `character` to the command line."""
    bake_app.command("face")(bake_face)
    bake_app.command("samples")(bake_samples)
    app.add_typer(bake_app, name="bake")
    app.add_typer(character_app, name="character")
