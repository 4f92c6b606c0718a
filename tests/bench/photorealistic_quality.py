"""How true the shipped photorealistic atlas is, against renders that it was not made from.

Run: python tests/bench/photorealistic_quality.py [WORK]. WORK is the bake's folder under build/bake; renders
missing there are made, one to three minutes each (needs Blender's environment, .venv-bake). Prints PSNR at
closures between the rendered levels, PSNR of a moved lower lid, and the opening in rendered pixels.
"""

import sys
from pathlib import Path

import numpy as np

from stimuli_builder.characters.atlas import SHIPPED, Character, load_character
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.photorealistic import plan
from stimuli_builder.characters.photorealistic.assembly import Assembly
from stimuli_builder.characters.photorealistic.development import psnr_db, to_8_bit
from stimuli_builder.characters.photorealistic.eyelid_skin import LidPose
from stimuli_builder.characters.photorealistic.framing import Frame
from stimuli_builder.characters.photorealistic.parameters import Face
from stimuli_builder.characters.photorealistic.renderer import Renderer, Shot

MIDPOINTS = (3 / 32, 13 / 32, 23 / 32)
MOVED = LidPose(0.5, plan.VERTICAL_MM, plan.HORIZONTAL_MM)
OPENINGS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)


def picture(character: Character, closure: float) -> np.ndarray:
    weights = character.level_weights([closure])[0]
    return sum(weights[i] * linear_level(character, int(i)) for i in np.flatnonzero(weights))


def linear_level(character: Character, index: int) -> np.ndarray:
    return srgb_to_linear(character.level_srgb(index))


def say(line: str) -> None:
    sys.stdout.write(line + "\n")


def main() -> None:
    character = load_character(SHIPPED / "photorealistic")
    made = character.declaration.provenance
    face = Face.model_validate(made["face"])
    quality = plan.Quality(made["samples"], made["frame_samples"])
    frame = Frame(*character.size_px)
    work = Path(sys.argv[1]) if len(sys.argv) > 1 else next(Path("build/bake").glob("northern-*"))
    middles = [plan.level_shot(work, frame, quality, closure) for closure in MIDPOINTS]
    moved = Shot(work / "true_moved.npz", MOVED, frame.eye_boxes(), quality.crop_samples)
    masks = [Shot(work / f"mask_{w:.3f}.npz", LidPose(w), frame.eye_boxes(), 4, "eye_mask") for w in OPENINGS]
    missing = [shot for shot in (*middles, moved, *masks) if not shot.file.exists()]
    if missing:
        blender = Path(".venv-bake/bin/python")
        with Renderer(blender, face, frame, work / "textures", work / "blender.log", 2) as renderer:
            for shot in missing:
                renderer.render(shot)
    assembly = Assembly(work, face, frame, quality)
    report_midpoints(character, assembly)
    report_lower_lid(character, assembly, moved)
    say("closure  wanted mm   left  right")
    for closure, mask in zip(OPENINGS, masks, strict=True):
        heights = [eye[..., 0].astype(float).clip(0, 1).sum(0).max() for eye in mask.read().values()]
        left, right = (height / frame.px_per_mm for height in heights)
        say(f"{closure:7.2f} {11 * (1 - closure):10.2f} {left:6.2f} {right:6.2f}")


def report_midpoints(character: Character, assembly: Assembly) -> None:
    say("closure  PSNR in dB (crop)")
    for closure in MIDPOINTS:
        truth = to_8_bit(assembly.level(closure))
        say(f"{closure:.5f} {psnr_db(linear_to_srgb(picture(character, closure)), truth):6.1f}")


def report_lower_lid(character: Character, assembly: Assembly, shot: Shot) -> None:
    window = character.lower_lid_layer.window
    still = picture(character, MOVED.closure)
    made = still + character.lower_lid_delta(MOVED.closure, MOVED.vertical_mm, MOVED.horizontal_mm)
    truth = to_8_bit(assembly.lay(assembly.still, shot))[character.crop][window]
    figures = [psnr_db(linear_to_srgb(image)[window], truth) for image in (made, still)]
    say(f"lower lid moved {MOVED.vertical_mm} mm up and {MOVED.horizontal_mm} mm nasally at closure 0.5:")
    say(f"{figures[0]:.1f} dB (left as it was: {figures[1]:.1f} dB)")


if __name__ == "__main__":
    main()
