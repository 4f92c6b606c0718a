"""How lower lids between rendered slides come out, by what mixes the poses: each pose from its neighbours.

Run: python tests/bench/pose_blends.py [NAME ...]. Leaves rendered slides out and makes each from those
0.5 mm before and after it, twice the way that clips bridge. Prints PSNR in dB of the lower lids' crop.
"""

import sys

import numpy as np

from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear
from stimuli_builder.characters.facekit.development import psnr_db
from stimuli_builder.characters.facekit.inbetween import flow_mix

STEP_MM, SLIDES_MM, LIFTS_MM = 0.5, (1.0, 2.5, 4.0), (0.0, 1.0)
Light = np.ndarray


def poses(name: str) -> dict[tuple[float, float], Light]:
    """Linear light of each pose's crop, by mm up and mm nasal."""
    atlas = load_atlas(SHIPPED / name)
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


def main() -> None:
    for name in sys.argv[1:] or ("alder", "birch", "cedar", "hazel"):
        at = poses(name)
        figures: dict[str, list[float]] = {}
        for lift in LIFTS_MM:
            for slide in SLIDES_MM:
                made = blends(at[lift, slide - STEP_MM], at[lift, slide + STEP_MM])
                for what, light in made.items():
                    told = psnr_db(linear_to_srgb(np.clip(light, 0, 1)), linear_to_srgb(at[lift, slide]))
                    figures.setdefault(what, []).append(told)
        line = "; ".join(f"{what} {min(each):.1f}-{max(each):.1f}" for what, each in figures.items())
        sys.stdout.write(f"{name}: {line}\n")


if __name__ == "__main__":
    main()
