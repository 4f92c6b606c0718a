"""How exact irises are: the rendered faces that ship, against the geometry they were made from.

    PYTHONPATH=. python tests/bench/bench_iris.py KIT.npz [every, 8]

KIT is ICT-FaceKit's packed file (docs/characters.md). The lids' points are the true ones with 1.5% of the
eye's width of noise. Errors in percent of the eye's width (middle) and of the true diameter.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from face_baking.identity import load_identity
from face_baking.kit import load_facekit
from face_baking.scene import FaceScene
from face_baking.training.draw import SamplePose
from face_baking.training.labels import labels_of
from face_baking.training.scene import SampleScene

from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.tracking.detector.detection import eye_points
from stimuli_builder.tracking.iris import measure_iris

FACES = ("alder@8", "birch@6", "cedar@4", "hazel@5", "alder-face@2", "cedar-face@2")
NOISE = 0.015
SEEN = ((0.0, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 1.01))


class AtlasScene(SampleScene):
    """The scene that a shipped face was rendered from."""

    def __init__(self, kit, name: str, size_px: tuple[int, int]) -> None:
        identity, _, framing = name.partition("@")[0].partition("-")
        FaceScene.__init__(self, kit, load_identity(identity), framing or "eyes", size_px)


def eyes(name: str, kit, every: int) -> Iterator[tuple]:
    """Grey picture and labels of each eye at every n-th closure of a face."""
    atlas = load_atlas(SHIPPED / name)
    scene = AtlasScene(kit, name, atlas.size_px)
    picture = linear_to_srgb(atlas.base_linear())
    for number in range(0, len(atlas.closures), every):
        picture[atlas.crop] = atlas.level_srgb(number)
        closure = float(atlas.closures[number])
        labels = labels_of(scene, SamplePose(closure, closure_right=closure))
        for eye in labels["eyes"].values():
            yield cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), eye


def measured(picture, eye: dict, rng: np.random.Generator) -> tuple[float, float, float] | None:
    """Share of the iris to be seen, and the errors of middle and diameter; None where no iris is seen."""
    upper, lower = np.array(eye["upper"]) - 0.5, np.array(eye["lower"]) - 0.5
    points = eye_points(upper[::-1], lower)
    width = float(np.hypot(*(points[5] - points[0])))
    seen = measure_iris(picture, points + rng.normal(0, NOISE * width, points.shape))
    if seen is None:
        return None
    middle, outline = np.array(eye["iris"]["centre"]) - 0.5, np.array(eye["iris"]["outline"])
    off = float(np.hypot(seen.x - middle[0], seen.y - middle[1])) / width
    return eye["iris"]["visible"], off, seen.diameter / float(np.ptp(outline[:, 0])) - 1


def main() -> None:
    kit, every = load_facekit(Path(sys.argv[1])), int(sys.argv[2]) if len(sys.argv) > 2 else 8
    rng = np.random.default_rng(1)
    pairs = [
        (eye["iris"]["visible"], measured(picture, eye, rng))
        for name in FACES
        for picture, eye in eyes(name, kit, every)
    ]
    for low, high in SEEN:
        those = [one for share, one in pairs if low <= share < high]
        given = np.array([one[1:] for one in those if one is not None]).reshape(-1, 2) * 100
        if len(given):
            off, wide = given.T
            sys.stdout.write(
                f"{low:.0%} to {high:.0%} of the iris seen: {len(given)} of {len(those)} measured; middle "
                f"{np.median(off):.1f} (90%: {np.percentile(off, 90):.1f}), diameter {np.median(wide):+.1f}, "
                f"90% within {np.percentile(abs(wide), 90):.1f}\n"
            )


if __name__ == "__main__":
    main()
