"""`stimuli bake samples`: synthetic training data for whatever finds eyelids in pictures."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from face_baking.cli_progress import baking
from face_baking.kit import load_facekit
from face_baking.renderer import DEVICES
from face_baking.training.run import LABELS_FILE, SamplesOrder, make_samples


def bake_samples(
    facekit: Annotated[
        Path, typer.Option(help="Your copy of ICT-FaceKit: its FaceXModel folder, or the packed .npz.")
    ],
    count: Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of pictures.")] = 100,
    out: Annotated[Path, typer.Option(help="Folder of the pictures and labels.jsonl.")] = Path("out/samples"),
    seed: Annotated[int, typer.Option(min=0, max=999_999, help="Random seed of the samples.")] = 1,
    width: Annotated[
        int, typer.Option(min=160, max=1920, help="Width in px; the height is half of it.")
    ] = 480,
    samples: Annotated[int, typer.Option(min=1, max=512, help="Cycles samples per pixel.")] = 6,
    blender: Annotated[
        Path, typer.Option(help="Environment of Blender; made on first use (360 MB to download).")
    ] = Path(".venv-bake"),
    device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu or gpu.")] = "auto",
    threads: Annotated[int, typer.Option(min=1, max=256, help="Render threads on the CPU.")] = 2,
) -> None:
    """Render labeled pictures: identities, gaze and head turn to 30 degrees, closures, frowns, light, rims.

    Every picture has a line in labels.jsonl: lid edges, canthi, the iris and its visible part. A
    stopped run continues where it was; a larger count adds pictures.

    Examples:

      stimuli bake samples --facekit ict_facekit.npz --count 8 --width 320

      stimuli bake samples --facekit ICT-FaceKit --count 5000 --device gpu --samples 16
    """
    if device not in DEVICES:
        raise InputError(f"device must be one of {', '.join(DEVICES)}; it is '{device}'")
    size = width // 2 * 2, width // 4 * 2
    order = SamplesOrder(count, seed, size, samples, out, blender, device, threads)
    with baking("samples") as report:
        make_samples(order, load_facekit(facekit), report)
    typer.echo(f"{count} samples are in {out}, their labels in {out / LABELS_FILE}")
