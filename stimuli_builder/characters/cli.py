"""`stimuli bake`: render a character's atlas."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from stimuli_builder.characters.cli_face import bake_face
from stimuli_builder.characters.cli_progress import baking
from stimuli_builder.characters.photorealistic.bake import BakeOrder, bake, write_atlas
from stimuli_builder.characters.photorealistic.framing import parse_size
from stimuli_builder.characters.photorealistic.parameters import PRESETS_FILE, load_preset
from stimuli_builder.characters.photorealistic.plan import LEVEL_COUNTS, Quality, closures_of

bake_app = typer.Typer(no_args_is_help=True, help="Render a character's atlas of baked pictures.")


@bake_app.callback()
def _bake() -> None:
    """Render a character's atlas of baked pictures."""


@bake_app.command("photorealistic")
def bake_photorealistic(
    preset: Annotated[str, typer.Option(help="Face to bake: a table of the presets file.")] = "northern",
    levels: Annotated[
        int, typer.Option(help=f"Closure levels of the atlas: one of {', '.join(map(str, LEVEL_COUNTS))}.")
    ] = 129,
    rendered: Annotated[
        int | None, typer.Option(help="How many of them to render; the others are moved in between [all].")
    ] = None,
    size: Annotated[str, typer.Option(help="Size of the full frame in px; it shows 128 mm.")] = "960x360",
    out: Annotated[Path | None, typer.Option(help="Folder of the character [out/characters/PRESET].")] = None,
    samples: Annotated[int, typer.Option(min=1, max=4096, help="Cycles samples per pixel of the crop.")] = 20,
    frame_samples: Annotated[
        int, typer.Option(min=1, max=4096, help="Cycles samples per pixel of the still frame.")
    ] = 32,
    presets: Annotated[Path, typer.Option(help="Presets file, to bake a face of your own.")] = PRESETS_FILE,
    work: Annotated[Path, typer.Option(help="Where rendered shots wait: a stopped bake resumes.")] = Path(
        "build/bake"
    ),
    blender: Annotated[
        Path, typer.Option(help="Environment of Blender; made on first use (360 MB to download).")
    ] = Path(".venv-bake"),
    render: Annotated[
        bool, typer.Option(help="--no-render writes the atlas from what is rendered so far.")
    ] = True,
    threads: Annotated[int, typer.Option(min=1, max=256, help="Render threads.")] = 2,
) -> None:
    """Render the photorealistic character with Cycles; coarse levels first, resumable at any moment.

    Examples:

      stimuli bake photorealistic --levels 9 --samples 16 --frame-samples 32      # a draft in minutes

      stimuli bake photorealistic --preset southern --levels 129 --out my/face    # an hour or two
    """
    closures_of(levels)
    closures_of(rendered or levels)
    if (rendered or levels) > levels:
        raise InputError(f"cannot render {rendered} levels of an atlas that has {levels}")
    order = BakeOrder(
        name=preset,
        face=load_preset(preset, presets),
        frame=parse_size(size),
        levels=levels,
        rendered=rendered or levels,
        quality=Quality(samples, frame_samples),
        out=out or Path("out/characters") / preset,
        work=work,
        blender=blender,
        threads=threads,
    )
    if not render:
        write_atlas(order)
        typer.echo(f"{levels} levels of '{preset}' are in {order.out}")
        return
    with baking(preset) as report:
        bake(order, report)
    typer.echo(f"{levels} levels of '{preset}' are in {order.out}")


def register(app: typer.Typer) -> None:
    """Add `bake` to the command line."""
    bake_app.command("face")(bake_face)
    app.add_typer(bake_app, name="bake")
