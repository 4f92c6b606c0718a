"""How far apart rendered levels may lie: pictures moved in between against the level rendered there.

Run: python tests/bench/level_spacing.py SHOTS (a bake's folder in --work, face-NAME-...). For every level
with rendered neighbours at one, two and four steps it prints the PSNR of the picture moved in between, and
the PSNR to which the three tend at no distance: what is left there is the noise of rendering, of the level
itself and of its neighbours, which only more samples lessen.

    e(d) = n + a d^p,   r = (e(4d) - e(2d)) / (e(2d) - e(d)) = 2^p                                       (1)
    n = e(d) - (e(2d) - e(d)) / (r - 1)                                                                  (2)

Letters: e mean square error at a distance of d steps, n what is left of it at none.
"""

import re
import sys
from pathlib import Path

import numpy as np
from face_baking.assembly import STUDIO_EV
from face_baking.development import develop, to_8_bit
from face_baking.inbetween import flow_mix
from numpy.typing import NDArray

from stimuli_builder.characters.colour import linear_to_srgb, srgb_to_linear

Picture = NDArray[np.uint8]


def pictures(folder: Path) -> dict[float, list[Picture]]:
    """Both eyes' boxes of every rendered level, by closure."""
    levels = {}
    for file in sorted(folder.glob("level_*.npz")):
        closure = float(re.sub("level_", "", file.stem))
        with np.load(file) as stored:
            boxes = [stored[name].astype(np.float32) for name in sorted(stored.files)]
        levels[closure] = [to_8_bit(develop(light, STUDIO_EV)) for light in boxes]
    return levels


def error(low: list[Picture], high: list[Picture], truth: list[Picture]) -> float:
    """Mean square error in code values of the pictures moved halfway between two levels."""
    each = []
    for a, b, wanted in zip(low, high, truth, strict=True):
        moved = linear_to_srgb(np.maximum(flow_mix(srgb_to_linear(a), srgb_to_linear(b), 0.5), 0))
        each.append(np.mean((moved.astype(float) - wanted) ** 2))
    return float(np.mean(each))


def decibels(square: float) -> float:
    """PSNR of 8-bit pictures; of none where the error is below 0."""
    return float(10 * np.log10(255**2 / square)) if square > 0 else float("inf")


def main() -> None:
    levels = pictures(Path(sys.argv[1]))
    step = float(np.diff(sorted(levels)).min())
    sys.stdout.write(
        f"closure  PSNR in dB of the boxes, {step:g}, {2 * step:g} and {4 * step:g} away; at none\n"
    )
    for closure, truth in levels.items():
        around = [(closure - k * step, closure + k * step) for k in (1, 2, 4)]
        if all(end in levels for ends in around for end in ends):
            e1, e2, e4 = (error(levels[low], levels[high], truth) for low, high in around)
            ratio = (e4 - e2) / (e2 - e1) if e2 > e1 else 0.0
            left = e1 - (e2 - e1) / (ratio - 1) if ratio > 1 else float("nan")
            said = "  ".join(f"{decibels(e):5.1f}" for e in (e1, e2, e4, left))
            sys.stdout.write(f"{closure:7.4f}  {said}\n")


if __name__ == "__main__":
    main()
