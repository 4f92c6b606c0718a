"""How true the shipped photorealistic atlas is, against renders that it was not made from.

Run: python tests/bench/photorealistic_quality.py [WORK]. WORK is the bake's folder under build/bake; renders
missing there are made, one to three minutes each (needs Blender's environment, .venv-bake). Prints PSNR
halfway between rendered levels and halfway between the atlas's levels, PSNR of a moved lower lid, and the
opening in rendered pixels.
"""

import sys
from pathlib import Path

import numpy as np

from stimuli_builder.characters.atlas import SHIPPED, Atlas, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.interpolation import level_weights
from stimuli_builder.characters.photorealistic import plan
from stimuli_builder.characters.photorealistic.assembly import Assembly
from stimuli_builder.characters.photorealistic.development import psnr_db, to_8_bit
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose
from stimuli_builder.characters.photorealistic.framing import Frame
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.renderer import Renderer, Shot
from tests.helpers.lower_lid_change import lower_lid_change

# The last one is where the lids almost meet.
PLACES = (0.1, 0.4, 0.7, 0.93)
# The widest blink on its way down, and both extremes at its end and, earlier than any blink, at half.
MOVED = tuple(
    LidPose(closure, plan.VERTICAL_MM[-1] * share, plan.HORIZONTAL_MM[-1] * share)
    for closure, share in ((0.5, 0.5), (0.75, 0.75), (0.875, 0.875), (1.0, 1.0), (0.5, 1.0))
)
# Lashes are thinner than a pixel: a reference rendered as coarsely as the atlas would bring noise of its own.
REFERENCE_SAMPLES = 160
OPENINGS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)


def midpoints(closures: list[float]) -> list[float]:
    """The middles of the steps at PLACES of the closing, where a picture between levels errs most."""
    steps = [(len(closures) - 1) * place for place in PLACES]
    return [(closures[int(step)] + closures[int(step) + 1]) / 2 for step in steps]


def picture(character: Atlas, closure: float) -> np.ndarray:
    weights = level_weights(character.closures, [closure])[0].astype(np.float32)
    return sum(weights[i] * linear_level(character, int(i)) for i in np.flatnonzero(weights))


def linear_level(character: Atlas, index: int) -> np.ndarray:
    return srgb_to_linear(character.level_srgb(index))


def say(line: str) -> None:
    sys.stdout.write(line + "\n")


def main() -> None:
    character = load_atlas(SHIPPED / "photorealistic")
    made = character.declaration.provenance
    face = Face.model_validate(made["face"])
    quality = plan.Quality(made["samples"], made["frame_samples"])
    frame = Frame(*character.size_px)
    work = Path(sys.argv[1]) if len(sys.argv) > 1 else next(Path("build/bake").glob("northern-*"))
    closures = [level.closure for level in character.declaration.levels]
    rendered, between = midpoints(made["rendered_closures"]), midpoints(closures)
    middles = [
        Shot(work / f"true_{w:.6f}_{samples}.npz", LidPose(w), frame.eye_boxes(), samples)
        for w in sorted({*rendered, *between})
        for samples in (quality.crop_samples, REFERENCE_SAMPLES)
    ]
    moved = [
        Shot(
            work / f"true_{p.closure}_{p.vertical_mm}_{p.horizontal_mm}.npz",
            p,
            frame.eye_boxes(),
            quality.crop_samples,
        )
        for p in MOVED
    ]
    masks = [Shot(work / f"mask_{w:.3f}.npz", LidPose(w), frame.eye_boxes(), 4, "eye_mask") for w in OPENINGS]
    missing = [shot for shot in (*middles, *moved, *masks) if not shot.file.exists()]
    if missing:
        blender = Path(".venv-bake/bin/python")
        with Renderer(blender, face, frame, work / "textures", work / "blender.log", 2) as renderer:
            for shot in missing:
                renderer.render(shot)
    assembly = Assembly(work, face, frame, quality)
    report_midpoints(
        character, assembly, "rendered levels", [m for m in middles if m.pose.closure in rendered]
    )
    report_midpoints(
        character, assembly, "the atlas's levels", [m for m in middles if m.pose.closure in between]
    )
    say("lower lid: closure, mm up, mm nasal, PSNR in dB (left as it was)")
    for shot in moved:
        report_lower_lid(character, assembly, shot)
    say("closure  wanted mm   left  right")
    for closure, mask in zip(OPENINGS, masks, strict=True):
        heights = [eye[..., 0].astype(float).clip(0, 1).sum(0).max() for eye in mask.read().values()]
        left, right = (height / frame.px_per_mm for height in heights)
        say(f"{closure:7.2f} {11 * (1 - closure):10.2f} {left:6.2f} {right:6.2f}")


def report_midpoints(character: Atlas, assembly: Assembly, what: str, shots: list[Shot]) -> None:
    say(f"closure  reference's samples  PSNR in dB (crop), halfway between {what}")
    for shot in shots:
        truth = to_8_bit(assembly.lay(assembly.still, shot))[character.crop]
        made = linear_to_srgb(picture(character, shot.pose.closure))
        say(f"{shot.pose.closure:.5f} {shot.samples:10d} {psnr_db(made, truth):16.1f}")


def report_lower_lid(character: Atlas, assembly: Assembly, shot: Shot) -> None:
    window, pose = character.lower_lid_layer.window, shot.pose
    still = picture(character, pose.closure)
    made = still + lower_lid_change(character, pose.closure, pose.vertical_mm, pose.horizontal_mm)
    truth = to_8_bit(assembly.lay(assembly.still, shot))[character.crop][window]
    figures = [psnr_db(linear_to_srgb(image)[window], truth) for image in (made, still)]
    place = f"{pose.closure:7.2f} {pose.vertical_mm:5.2f} {pose.horizontal_mm:5.2f}"
    say(f"{place} {figures[0]:6.1f} ({figures[1]:.1f})")


if __name__ == "__main__":
    main()
