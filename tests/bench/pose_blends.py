"""How lower lids between rendered slides come out, by what mixes the poses: each pose from its neighbours.

Run: python tests/bench/pose_blends.py [NAME ...] [--facekit FACEKIT]. Leaves slides out and makes each from
those 0.5, 1 and 2.5 mm before and after it, and the lift of 0.5 mm from those of 0 and 1. Prints PSNR in dB
of the lower lids' crop; with the face kit also of poses moved as its mesh moves.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from face_baking.development import psnr_db
from face_baking.identity import Identity
from face_baking.inbetween import flow_mix
from face_baking.kit import load_facekit
from face_baking.lid_pose import LidPose
from face_baking.pose_motion import pose_between
from face_baking.scene import FaceScene

from stimuli_builder.characters.atlas import SHIPPED, Atlas, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear

Place = tuple[float, float]
"""mm up and mm nasal."""
Light = np.ndarray
WAYS: dict[str, list[tuple[Place, Place, Place]]] = {
    f"slides {step:g} mm away": [
        ((lift, slide), (lift, slide - step), (lift, slide + step)) for lift in (0.0, 1.0) for slide in slides
    ]
    for step, slides in ((0.5, (1.0, 2.5, 4.0)), (1.0, (1.0, 2.5, 4.0)), (2.5, (2.5,)))
}
WAYS["lifts 0.5 mm away"] = [((0.5, slide), (0.0, slide), (1.0, slide)) for slide in (0.0, 2.5, 5.0)]
"""What is left out, and what it is made from."""


def poses(atlas: Atlas) -> dict[Place, Light]:
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


def scene_of(atlas: Atlas, facekit: Path) -> FaceScene:
    """The scene that a shipped face was rendered from."""
    identity = Identity.model_validate(atlas.declaration.provenance["face"])
    return FaceScene(load_facekit(facekit), identity, "eyes", atlas.size_px)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="alder@8, birch@6, cedar@4 and hazel@5")
    parser.add_argument("--facekit", type=Path, help="your copy of ICT-FaceKit")
    asked = parser.parse_args()
    for name in asked.names or ("alder@8", "birch@6", "cedar@4", "hazel@5"):
        atlas = load_atlas(SHIPPED / name)
        scene = scene_of(atlas, asked.facekit) if asked.facekit else None
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


if __name__ == "__main__":
    main()
