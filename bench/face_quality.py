"""How true a shipped face is, against renders that it was not made from.

    python -m bench.face_quality compare NAME FACEKIT
    python -m bench.face_quality spacing SHOTS
    python -m bench.face_quality blends [NAME ...] [--facekit FACEKIT]

compare: renders what it needs into --work, a minute or so a
picture; needs Blender's environment (--blender, .venv-bake). Prints the PSNR halfway between rendered levels
and halfway between the atlas's levels, and of lower lids on their way.

The references have as many samples as the levels, so that their own noise counts as error too. --samples 48
renders references with a quarter of it; --closures 0.094,0.906 leaves out the others, and the lower lid's.
--seeds 2,3 renders each with both seeds, other noise than the levels', and counts that noise honestly:

    n = mean((a - b)^2) / 4,   e = mean((x - (a + b) / 2)^2) - n                                          (1)

Letters: a, b references, x the atlas's picture, n the noise of the references' mean, e the error without it.

spacing: how far apart rendered levels may lie. SHOTS is a bake's folder in --work, face-NAME-.... For every
level with rendered neighbors at one, two and four steps it prints the PSNR of the picture moved in
between, and the PSNR to which the three tend at no distance: what is left there is the noise of rendering,
of the level itself and of its neighbors, which only more samples lessen.

    e(d) = n + a d^p,   r = (e(4d) - e(2d)) / (e(2d) - e(d)) = 2^p                                       (2)
    n = e(d) - (e(2d) - e(d)) / (r - 1)                                                                  (3)

Letters: e mean square error at a distance of d steps, n what is left of it at none.

blends: how lower lids between rendered slides come out, by what mixes the poses. Leaves slides out and
makes each from those 0.5, 1 and 2.5 mm before and after it, and the lift of 0.5 mm from those of 0 and 1.
Prints PSNR in dB of the lower lids' crop; with the face kit also of poses moved as its mesh moves.
"""

import argparse
import re
import sys
from pathlib import Path

import numpy as np
from face_baking.assembly import STUDIO_EV
from face_baking.bake import RECIPE
from face_baking.development import (
    develop,
    error_and_noise,
    error_db,
    photographed,
    psnr_db,
    to_8_bit,
)
from face_baking.environment import ensure_blender
from face_baking.identity import Identity
from face_baking.inbetween import flow_mix
from face_baking.kit import load_facekit
from face_baking.lid_pose import HORIZONTAL_MM, VERTICAL_MM, LidPose
from face_baking.pose_motion import pose_between
from face_baking.renderer import Renderer, Setup, Shot
from face_baking.scene import FaceScene
from numpy.typing import NDArray

from bench.harness import run_part, say
from stimuli_builder.characters.atlas import SHIPPED, Atlas, load_atlas
from stimuli_builder.characters.colour import level_weights, linear_to_srgb, srgb_to_linear
from tests.helpers.lower_lid_change import lower_lid_change

# The last one is where the lids almost meet.
SHARES = (0.1, 0.4, 0.7, 0.93)
# The widest blink on its way down, and both extremes at its end and, earlier than any blink, at half.
MOVED = tuple(
    LidPose(closure, VERTICAL_MM[-1] * share, HORIZONTAL_MM[-1] * share)
    for closure, share in ((0.5, 0.5), (0.75, 0.75), (0.875, 0.875), (1.0, 1.0), (0.5, 1.0))
)


def midpoints(closures: list[float]) -> list[float]:
    """The middles of the steps at PLACES of the closing, where a picture between levels errs most."""
    steps = [int((len(closures) - 1) * share) for share in SHARES]
    return [(closures[step] + closures[step + 1]) / 2 for step in steps]


def picture(character: Atlas, closure: float) -> np.ndarray:
    """(h, w, 3) linear light of the crop as clips mix it from the neighboring levels."""
    weights = level_weights(character.closures, [closure])[0].astype(np.float32)
    return sum(weights[i] * srgb_to_linear(character.level_srgb(int(i))) for i in np.flatnonzero(weights))


def laid_out(character: Atlas, scene: FaceScene, shot: Shot) -> np.ndarray:
    """(h, w, 3) code values of the crop with a shot's boxes over the open level, as an atlas is made."""
    x0, y0 = character.declaration.crop[:2]
    lens_px = character.declaration.provenance.get("lens_px", 0.0)
    out = character.level_srgb(0).astype(np.float32) / 255
    for name, light in shot.read().items():
        x, y, width, height = box = shot.boxes[name]
        where = out[y - y0 : y - y0 + height, x - x0 : x - x0 + width]
        where += scene.view.feather(box) * (
            photographed(light, scene.identity.exposure_ev + STUDIO_EV, lens_px) - where
        )
    return to_8_bit(out)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", help="a shipped face")
    parser.add_argument("facekit", type=Path, help="your copy of ICT-FaceKit")
    parser.add_argument("--work", type=Path, help="where renders wait (build/bake/truth-NAME-SAMPLES)")
    parser.add_argument("--samples", type=int, help="of the references (as many as the levels have)")
    parser.add_argument("--seeds", type=seed_pair, help="two, of references with independent noise")
    parser.add_argument("--closures", type=closure_list, help="these alone, separated by commas")
    parser.add_argument("--blender", type=Path, default=Path(".venv-bake"), help="Blender's environment")
    parser.add_argument("--threads", type=int, default=2, help="render threads on the CPU")
    return parser.parse_args()


def closure_list(text: str) -> list[float]:
    return [float(part) for part in text.split(",")]


def seed_pair(text: str) -> tuple[int, int]:
    first, second = (int(part) for part in text.split(","))
    if first == second:
        raise ValueError("two references with one seed have one noise")
    return first, second


def scene_of(character: Atlas, facekit: Path) -> FaceScene:
    """The scene in the character's provenance; a line if the recipe has changed since."""
    made = character.declaration.provenance
    framing = "face" if "--framing face" in made["command"] else "eyes"
    if made["recipe"] != RECIPE:
        say(
            f"{character.name} is of recipe {made['recipe']}, the references of {RECIPE}: "
            "they differ in what the recipes of docs/explanation/face-quality.md say"
        )
    identity = Identity.model_validate(made["face"])
    return FaceScene(load_facekit(facekit), identity, framing, character.size_px)


def references(
    scene: FaceScene, poses: list[LidPose], samples: int, asked: argparse.Namespace, seed: int = 1
) -> dict[LidPose, Shot]:
    """Shots of the poses, those rendered that are missing."""
    work = asked.work or Path("build/bake") / f"truth-{asked.name}-{samples}"
    work = work if seed == 1 else work / f"seed-{seed}"
    work.mkdir(parents=True, exist_ok=True)
    shots = {
        pose: Shot(
            work / f"true_{pose.closure:.6f}_{pose.vertical_mm}_{pose.horizontal_mm}.npz",
            pose,
            scene.boxes,
            samples,
        )
        for pose in poses
    }
    missing = [shot for shot in shots.values() if not shot.file.exists()]
    if missing:
        python = ensure_blender(asked.blender)
        setup = Setup(python, "studio", "auto", asked.threads, work / "blender.log", seed)
        with Renderer(scene, setup) as renderer:
            for shot in missing:
                renderer.render(shot)
    return shots


def compare_face() -> None:
    asked = arguments()
    character = load_atlas(SHIPPED / asked.name)
    made = character.declaration.provenance
    scene = scene_of(character, asked.facekit)
    places = {"given": asked.closures or []}
    moved: list[LidPose] = []
    if asked.closures is None:
        places = {
            "halfway between rendered levels": midpoints(made["rendered_closures"]),
            "halfway between the atlas's levels": midpoints(
                [level.closure for level in character.declaration.levels]
            ),
        }
        moved = list(MOVED) if character.has_lower_lid else []
    samples = asked.samples or made["samples"]
    still = [LidPose(closure) for closures in places.values() for closure in closures]
    if asked.seeds:
        say_by_two_seeds(character, scene, still, samples, asked)
        return
    shots = references(scene, [*still, *moved], samples, asked)
    say(f"{asked.name}: levels of {made['samples']} samples, references of {samples}")
    for what, closures in places.items():
        say(f"closure  PSNR in dB (crop), {what}")
        for closure in closures:
            truth = laid_out(character, scene, shots[LidPose(closure)])
            say(f"{closure:.5f} {psnr_db(linear_to_srgb(picture(character, closure)), truth):8.1f}")
    if moved:
        say("lower lid: closure, mm up, mm nasal, PSNR in dB (left as it was)")
    for pose in moved:
        say(lower_lid_line(character, laid_out(character, scene, shots[pose]), pose))


def say_by_two_seeds(
    character: Atlas, scene: FaceScene, poses: list[LidPose], samples: int, asked: argparse.Namespace
) -> None:
    """PSNR of levels without the references' noise, and of that noise, equation (1) above."""
    first, second = (references(scene, poses, samples, asked, seed) for seed in asked.seeds)
    say("closure  PSNR in dB (crop) without the references' noise; of the mean of both references")
    for pose in poses:
        pictures = (laid_out(character, scene, shots[pose]) for shots in (first, second))
        error, noise = error_and_noise(linear_to_srgb(picture(character, pose.closure)), *pictures)
        say(f"{pose.closure:.5f} {error_db(error):8.1f} {error_db(noise):8.1f}")


def lower_lid_line(character: Atlas, truth: np.ndarray, pose: LidPose) -> str:
    """What clips make of a pose of the lower lid against its render."""
    window = character.lower_lid_layer.window
    still = picture(character, pose.closure)
    change = lower_lid_change(character, pose.closure, pose.vertical_mm, pose.horizontal_mm)
    figures = [psnr_db(linear_to_srgb(image)[window], truth[window]) for image in (still + change, still)]
    closure_text = f"{pose.closure:7.3f} {pose.vertical_mm:5.2f} {pose.horizontal_mm:5.2f}"
    return f"{closure_text} {figures[0]:6.1f} ({figures[1]:.1f})"


Boxes = NDArray[np.uint8]


def pictures(folder: Path) -> dict[float, list[Boxes]]:
    """Both eyes' boxes of every rendered level, by closure."""
    levels = {}
    for file in sorted(folder.glob("level_*.npz")):
        closure = float(re.sub("level_", "", file.stem))
        with np.load(file) as stored:
            boxes = [stored[name].astype(np.float32) for name in sorted(stored.files)]
        levels[closure] = [to_8_bit(develop(light, STUDIO_EV)) for light in boxes]
    return levels


def moved_error(low: list[Boxes], high: list[Boxes], truth: list[Boxes]) -> float:
    """Mean square error in code values of the pictures moved halfway between two levels."""
    each = []
    for a, b, rendered in zip(low, high, truth, strict=True):
        moved = linear_to_srgb(np.maximum(flow_mix(srgb_to_linear(a), srgb_to_linear(b), 0.5), 0))
        each.append(np.mean((moved.astype(float) - rendered) ** 2))
    return float(np.mean(each))


def decibels(square: float) -> float:
    """PSNR of 8-bit pictures; of none where the error is below 0."""
    return float(10 * np.log10(255**2 / square)) if square > 0 else float("inf")


def measure_spacing() -> None:
    levels = pictures(Path(sys.argv[1]))
    step = float(np.diff(sorted(levels)).min())
    sys.stdout.write(
        f"closure  PSNR in dB of the boxes, {step:g}, {2 * step:g} and {4 * step:g} away; at none\n"
    )
    for closure, truth in levels.items():
        around = [(closure - k * step, closure + k * step) for k in (1, 2, 4)]
        if all(end in levels for ends in around for end in ends):
            e1, e2, e4 = (moved_error(levels[low], levels[high], truth) for low, high in around)
            ratio = (e4 - e2) / (e2 - e1) if e2 > e1 else 0.0
            left = e1 - (e2 - e1) / (ratio - 1) if ratio > 1 else float("nan")
            said = "  ".join(f"{decibels(e):5.1f}" for e in (e1, e2, e4, left))
            sys.stdout.write(f"{closure:7.4f}  {said}\n")


Shift = tuple[float, float]
"""mm up and mm nasal."""
Light = np.ndarray
WAYS: dict[str, list[tuple[Shift, Shift, Shift]]] = {
    f"slides {step:g} mm away": [
        ((lift, slide), (lift, slide - step), (lift, slide + step)) for lift in (0.0, 1.0) for slide in slides
    ]
    for step, slides in ((0.5, (1.0, 2.5, 4.0)), (1.0, (1.0, 2.5, 4.0)), (2.5, (2.5,)))
}
WAYS["lifts 0.5 mm away"] = [((0.5, slide), (0.0, slide), (1.0, slide)) for slide in (0.0, 2.5, 5.0)]
"""What is left out, and what it is made from."""


def poses(atlas: Atlas) -> dict[Shift, Light]:
    """Linear light of each pose's crop."""
    lower = atlas.declaration.lower_lid
    return {
        (pose.vertical_mm, pose.horizontal_mm): srgb_to_linear(atlas.pose_srgb(pose, lower.crop[2:]))
        for pose in lower.poses
    }


def blends(before: Light, after: Light) -> dict[str, Light]:
    """The pose in the middle: the nearest, cross-faded in light and in code values, along the flow."""
    codes = (linear_to_srgb(before).astype(np.float32) + linear_to_srgb(after)) / 2
    return {
        "nearest": before,
        "linear light": (before + after) / 2,
        "code values": srgb_to_linear(np.rint(codes).astype(np.uint8)),
        "optical flow": flow_mix(before, after, 0.5),
    }


def scene_of_atlas(atlas: Atlas, facekit: Path) -> FaceScene:
    """The scene that a shipped face was rendered from."""
    identity = Identity.model_validate(atlas.declaration.provenance["face"])
    return FaceScene(load_facekit(facekit), identity, "eyes", atlas.size_px)


def compare_blends() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="alder@8, birch@6 and cedar@4")
    parser.add_argument("--facekit", type=Path, help="your copy of ICT-FaceKit")
    asked = parser.parse_args()
    for name in asked.names or ("alder@8", "birch@6", "cedar@4"):
        atlas = load_atlas(SHIPPED / name)
        scene = scene_of_atlas(atlas, asked.facekit) if asked.facekit else None
        at, crop = poses(atlas), atlas.declaration.lower_lid.crop
        for way, left_out in WAYS.items():
            figures: dict[str, list[float]] = {}
            for middle, *ends in left_out:
                made = blends(*(at[end] for end in ends))
                if scene is not None:
                    around = {LidPose(0.0, *end): at[end] for end in ends}
                    made["mesh"] = pose_between(scene, LidPose(0.0, *middle), around, crop)
                for what, light in made.items():
                    told = psnr_db(linear_to_srgb(np.clip(light, 0, 1)), linear_to_srgb(at[middle]))
                    figures.setdefault(what, []).append(told)
            line = "; ".join(f"{what} {min(each):.1f}-{max(each):.1f}" for what, each in figures.items())
            sys.stdout.write(f"{name}, {way}: {line}\n")
            sys.stdout.flush()


PARTS = {
    "compare": compare_face,
    "spacing": measure_spacing,
    "blends": compare_blends,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
