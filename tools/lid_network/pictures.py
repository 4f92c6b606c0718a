"""Labelled eyes for the lid network, all made by this project: rendered samples, shipped faces, the actor.

    python -m tools.lid_network.pictures OUT.npz --facekit KIT.npz [--samples FOLDER]... [--actors 60]

Each eye is cut out at one size (96 px from canthus to canthus). Truth is exact: samples carry it
(`stimuli bake samples`), of the faces that ship it is read off the geometry they were rendered from, of the
actor it is its own. Runs in the project's environment; `train.py` needs torch and reads OUT.npz alone.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from face_baking.identity import load_identity
from face_baking.kit import FaceKit, load_facekit
from face_baking.scene import FaceScene
from face_baking.training.draw import SamplePose
from face_baking.training.labels import labels_of
from face_baking.training.scene import SampleScene
from numpy.typing import NDArray
from PIL import Image

from stimuli_builder.actor.face import (
    EYE_CENTRES,
    EYE_WIDTH_PX,
    head_matrix,
    lower_margin,
    upper_margin,
)
from stimuli_builder.actor.recording import Actor, ActorOptions
from stimuli_builder.actor.renderer import IRIS_RADIUS
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.tracking.detector.detection import along

EYE_PX, CUT = 96.0, (192, 160)
CURVE = 11
"""Points of each lid, canthi included, at even shares of its length."""
FACES = ("alder@8", "birch@6", "cedar@4", "hazel@5", "alder-face@2", "cedar-face@2")
ACTOR_FRAMES = 10
Values = NDArray[np.float64]


@dataclass(frozen=True)
class Eye:
    """An eye in its picture: lids (25, 2) from image-left to image-right; iris (x, y, radius); all in px."""

    picture: NDArray[np.uint8]
    upper: Values
    lower: Values
    iris: Values
    visible: float
    source: str


class AtlasScene(SampleScene):
    """The scene that a shipped face was rendered from."""

    def __init__(self, kit: FaceKit, identity: str, framing: str, size_px: tuple[int, int]) -> None:
        FaceScene.__init__(self, kit, load_identity(identity), framing, size_px)


def labelled_eyes(picture: NDArray[np.uint8], labels: dict[str, Any], source: str) -> Iterator[Eye]:
    """Both eyes of a rendered picture whose labels have their origin at the first pixel's corner."""
    for eye in labels["eyes"].values():
        upper, lower = np.array(eye["upper"]) - 0.5, np.array(eye["lower"]) - 0.5
        if upper[0, 0] > upper[-1, 0]:
            upper, lower = upper[::-1], lower[::-1]
        outline = np.array(eye["iris"]["outline"])
        radius = np.sqrt(cv2.contourArea(outline.astype(np.float32)) / np.pi)
        iris = np.array([*(np.array(eye["iris"]["centre"]) - 0.5), radius])
        yield Eye(picture, upper, lower, iris, float(eye["iris"]["visible"]), source)


def sample_eyes(folder: Path) -> Iterator[Eye]:
    """Eyes of a folder that `stimuli bake samples` wrote."""
    for line in (folder / "labels.jsonl").read_text(encoding="utf-8").splitlines():
        sample = json.loads(line)
        picture = np.array(Image.open(folder / sample["file"]).convert("RGB"))
        yield from labelled_eyes(picture, sample, f"sample {sample['identity']}")


def face_eyes(name: str, kit: FaceKit, every: int) -> Iterator[Eye]:
    """Eyes of a shipped face at every n-th of its closures."""
    atlas = load_atlas(SHIPPED / name)
    framing = "face" if name.endswith("-face") else "eyes"
    scene = AtlasScene(kit, name.removesuffix("-face"), framing, atlas.size_px)
    base = linear_to_srgb(atlas.base_linear())
    rows, columns = atlas.crop
    for number in range(0, len(atlas.closures), every):
        picture = base.copy()
        picture[rows, columns] = atlas.level_srgb(number)
        closure = float(atlas.closures[number])
        yield from labelled_eyes(picture, labels_of(scene, SamplePose(closure, closure_right=closure)), name)


def actor_eyes(seed: int) -> Iterator[Eye]:
    """Eyes of a few frames of the synthetic actor."""
    actor = Actor(ActorOptions(seconds=8, fps=60, seed=seed, noise=0))
    rng = np.random.default_rng([seed, 9])
    closed = np.flatnonzero(actor.course.closure.max(1) > 0.1)
    any_frame = rng.integers(0, actor.options.frame_count, ACTOR_FRAMES // 2)
    numbers = [*rng.choice(closed, ACTOR_FRAMES // 2), *any_frame] if len(closed) else any_frame
    for number in numbers:
        luma, _ = actor.frame(int(number))
        yield from _eyes_of_actor(actor, int(number), np.repeat(luma[..., None], 3, axis=2), seed)


def _eyes_of_actor(actor: Actor, number: int, picture: NDArray[np.uint8], seed: int) -> Iterator[Eye]:
    matrix, u = head_matrix(actor.course.head[number]), np.linspace(-0.5, 0.5, 41)
    for eye, centre in enumerate(EYE_CENTRES):
        closure = float(actor.course.closure[number, eye])

        def placed(local: Values, eye: int = eye, centre: tuple[float, float] = centre) -> Values:
            still = local * EYE_WIDTH_PX * [1 - 2 * eye, 1] + centre
            return np.asarray(still @ matrix[:, :2].T + matrix[:, 2])

        upper = placed(np.array([(x, upper_margin(x, closure)) for x in u]))
        lower = placed(np.array([(x, lower_margin(x, closure)) for x in u]))
        gaze = actor.course.gaze[number] * [1 - 2 * eye, 1]
        ((x, y),) = placed(np.array([[gaze[0], gaze[1] - 0.035]]))
        if eye:
            upper, lower = upper[::-1], lower[::-1]
        radius = IRIS_RADIUS * EYE_WIDTH_PX * float(np.hypot(*matrix[0, :2]))
        yield Eye(picture, upper, lower, np.array([x, y, radius]), 1 - closure, f"actor {seed}")


def cut_out(eye: Eye) -> dict[str, Any]:
    """The eye at the network's own size, with `CURVE` points a lid."""
    ends = (eye.upper[[0, -1]] + eye.lower[[0, -1]]) / 2
    scale = EYE_PX / float(np.hypot(*(ends[1] - ends[0])))
    middle = ends.mean(0)
    shift = (np.array(CUT) - 1) / 2 - scale * middle
    matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    blur = 0.45 / scale if scale < 0.8 else 0.0
    picture = cv2.GaussianBlur(eye.picture, (0, 0), blur) if blur else eye.picture
    cut = cv2.warpAffine(picture, matrix, CUT, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101)
    shares = np.linspace(0, 1, CURVE)
    lids = []
    for lid in (eye.upper, eye.lower):
        points = along(lid, shares.tolist())
        points[[0, -1]] = ends
        lids.append(points * scale + shift)
    iris = np.array([*(eye.iris[:2] * scale + shift), eye.iris[2] * scale])
    return {
        "picture": cut,
        "lids": np.stack(lids),
        "iris": iris,
        "visible": eye.visible,
        "source": eye.source,
    }


def collected(options: argparse.Namespace) -> Iterator[Eye]:
    """Eyes of all sources."""
    for folder in options.samples:
        yield from sample_eyes(folder)
    kit = load_facekit(options.facekit)
    for name in FACES[: options.faces]:
        yield from face_eyes(name, kit, options.every)
    for seed in range(options.actors):
        yield from actor_eyes(1000 + seed)


def main(arguments: list[str] | None = None) -> None:
    """Write every eye into one file."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--facekit", type=Path, required=True)
    parser.add_argument("--samples", type=Path, action="append", default=[])
    parser.add_argument("--faces", type=int, default=len(FACES))
    parser.add_argument("--every", type=int, default=2)
    parser.add_argument("--actors", type=int, default=60)
    options = parser.parse_args(arguments)
    cuts = [cut_out(eye) for eye in collected(options)]
    arrays: dict[str, Any] = {key: np.array([cut[key] for cut in cuts]) for key in cuts[0]}
    np.savez(options.out, **arrays)
    print(f"{len(cuts)} eyes in {options.out}")


if __name__ == "__main__":
    main()
