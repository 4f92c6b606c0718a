"""`stimuli bake face`: a character on face-kit geometry."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from face_baking.bake import FaceBake, FaceOrder, character_name
from face_baking.cli_progress import baking
from face_baking.framing import parse_size
from face_baking.identity import (
    IDENTITIES_FILE,
    Identity,
    identity_of_seed,
    load_identity,
)
from face_baking.kit import load_facekit
from face_baking.plan import Samples, closures_of
from face_baking.renderer import DEVICES, load_light
from stimuli_builder.characters.atlas import next_version


def bake_face(
    facekit: Annotated[
        Path, typer.Option(help="Your copy of ICT-FaceKit: its FaceXModel folder, or the packed .npz.")
    ],
    identity: Annotated[
        str | None, typer.Option(help="Face to bake: the name of a table in the identities file.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Random seed of the whole face, 0 to 999999.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the character [out/characters/NAME].")] = None,
    framing: Annotated[str, typer.Option(help="eyes, or face (forehead to chin).")] = "eyes",
    levels: Annotated[int, typer.Option(help="Closure levels of the atlas: 2^k + 1, up to 129.")] = 129,
    rendered: Annotated[
        int | None, typer.Option(help="Number of levels to render; the others are interpolated [all].")
    ] = None,
    denser_ends: Annotated[
        bool, typer.Option(help="Render twice as many in the first and last eighth of the closure.")
    ] = False,
    size: Annotated[
        str | None, typer.Option(help="Size of the full frame in px [960x360 or 720x900].")
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            min=1, max=4096, help="Cycles samples per pixel of the eyes; hair uses four times as many."
        ),
    ] = 24,
    frame_samples: Annotated[
        int, typer.Option(min=1, max=4096, help="Cycles samples per pixel of the still frame.")
    ] = 32,
    lid_samples: Annotated[
        int,
        typer.Option(
            min=0,
            max=4096,
            help=(
                "Cycles samples per pixel where lids and lashes move, twice as many beyond half closure; the "
                "skin around them then keeps the still frame's noise [as --samples]."
            ),
        ),
    ] = 0,
    lower_lid: Annotated[
        bool, typer.Option(help="--no-lower-lid omits the poses that Experiment 3 needs (17 pictures).")
    ] = True,
    version: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=9999,
            help="Version of a face that was already published, as NAME@VERSION [the next unused version].",
        ),
    ] = None,
    light: Annotated[str, typer.Option(help="Light preset: studio or window.")] = "studio",
    identities: Annotated[
        Path, typer.Option(help="Identities file, to bake your own face.", show_default="the shipped one")
    ] = IDENTITIES_FILE,
    work: Annotated[
        Path, typer.Option(help=("Folder of rendered levels, from which a stopped bake resumes."))
    ] = Path("build/bake"),
    blender: Annotated[
        Path, typer.Option(help="Environment of Blender; made on first use (360 MB to download).")
    ] = Path(".venv-bake"),
    device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu or gpu.")] = "auto",
    render: Annotated[
        bool, typer.Option(help="--no-render writes the atlas from the levels rendered so far.")
    ] = True,
    threads: Annotated[int, typer.Option(min=1, max=256, help="Render threads on the CPU.")] = 2,
) -> None:
    """Render a face on ICT-FaceKit geometry with Cycles; coarse levels first, resumable at any moment.

    Examples:

      stimuli bake face --facekit ICT-FaceKit --identity alder --levels 9 --samples 12   # a draft

      stimuli bake face --facekit ict_facekit.npz --seed 4711 --out my/face

      stimuli bake face --facekit ICT-FaceKit --identity birch --framing face --rendered 17   # birch-face
    """
    closures_of(levels)
    closures_of(rendered or levels)
    if (rendered or levels) > levels:
        raise InputError(f"cannot render {rendered} levels of an atlas that has {levels}")
    if device not in DEVICES:
        raise InputError(f"device must be one of {', '.join(DEVICES)}; it is '{device}'")
    load_light(light)
    name, face = _face(identity, seed, identities)
    version = version or next_version(character_name(name, framing))
    order = FaceOrder(
        name=name,
        seed=seed,
        identity=face,
        framing=framing,
        size_px=parse_size(size, framing),
        levels=levels,
        rendered=rendered or levels,
        samples=Samples(samples, frame_samples, lid_samples),
        lower_lid=lower_lid,
        light=light,
        out=out or Path("out/characters") / character_name(name, framing, version),
        work=work,
        blender=blender,
        device=device,
        threads=threads,
        denser_ends=denser_ends and (rendered or levels) < levels,
        version=version,
    )
    bake = FaceBake(order, load_facekit(facekit))
    if render:
        with baking(name) as report:
            bake.run(report)
    else:
        bake.write()
    typer.echo(f"'{order.character}' is in {order.out}")


def _face(name: str | None, seed: int | None, file: Path) -> tuple[str, Identity]:
    if (name is None) == (seed is None):
        raise InputError("use either --identity NAME or --seed NUMBER, not both")
    if seed is not None:
        return f"face-{seed}", identity_of_seed(seed)
    return str(name), load_identity(str(name), file)
