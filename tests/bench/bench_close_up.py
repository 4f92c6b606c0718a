"""How the lids of one eye are read in a close-up: the detector against exact or hand-placed lids.

    PYTHONPATH=. python tests/bench/bench_close_up.py KIT.npz [FOLDER] [FACES, 2]

KIT is ICT-FaceKit's packed file (docs/characters.md). Each eye of the rendered faces that ship, at nine
closures, and of FOLDER's single_face (../shared/data/face_video; labels good to 3 to 6%) is enlarged to 416
px of a picture of 640 x 480; FOLDER's short_human_3blink is a close-up. Mean distance of the lids from the
true ones in percent of the eye's width: of all pictures, of those open, of those shut; correlation of the
lid distance; height of the widest opening beside the true one; and how long the eye was looked for and read.
FACES are so many of the rendered faces (6 at most, 0: recordings alone): two are a sample, since all six did
not end within an hour on two busy cores. The recordings come first, and each line is printed as soon as it is
known. Needs the detector's environment, made at first use.
"""

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from bench_iris import FACES, AtlasScene
from face_baking.kit import load_facekit
from face_baking.training.draw import SamplePose
from face_baking.training.labels import labels_of

from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.tracking.certainty import lid_offsets
from stimuli_builder.tracking.detector.detection import eye_points
from stimuli_builder.tracking.detector.mesh import open_detector
from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.shapes import Points, default_markers, inter_eyelid_distances, widths
from stimuli_builder.video import Picture, frames, rgb

FOLDER = Path("../shared/data/face_video")
WIDTH_PX, SAMPLE = 416, 2
MIRRORED = [5, 4, 3, 2, 1, 0, 8, 7, 6]
Clip = tuple[str, list[Picture], list[Picture], list[Points]]


def enlarged(picture: Picture, points: Points, middle: Points, shift: Points) -> tuple[Picture, Points]:
    """A picture of 640 x 480 with an eye of 416 px, the middle of `middle`'s canthi `shift` from its own."""
    scale = WIDTH_PX / widths(middle)
    away = np.array([320, 240]) + shift - scale * (middle[0] + middle[5]) / 2
    matrix = np.array([[scale, 0, away[0]], [0, scale, away[1]]])
    return cv2.warpAffine(picture, matrix, (640, 480), flags=cv2.INTER_CUBIC), points * scale + away


def from_left(eye: Points) -> Points:
    """The points as one-eye files have them, from the image-left canthus."""
    return eye if eye[0, 0] < eye[5, 0] else eye[MIRRORED]


def rendered(kit, faces: int) -> Iterator[Clip]:
    rng = np.random.default_rng(0)
    for name in FACES[:faces]:
        atlas = load_atlas(SHIPPED / name)
        scene = AtlasScene(kit, name, atlas.size_px)
        picture, pictures = linear_to_srgb(atlas.base_linear()), []
        eyes: dict[str, list[Points]] = {"left": [], "right": []}
        for number in np.linspace(0, len(atlas.closures) - 1, 9).astype(int).tolist():
            picture[atlas.crop] = atlas.level_srgb(number)
            pictures.append(picture.copy())
            closure = float(atlas.closures[number])
            for side, eye in labels_of(scene, SamplePose(closure, closure_right=closure))["eyes"].items():
                upper, lower = np.array(eye["upper"]) - 0.5, np.array(eye["lower"]) - 0.5
                eyes[side].append(from_left(eye_points(upper[::-1], lower)))
        for side, points in eyes.items():
            middle, shift = np.mean(points, axis=0), rng.uniform(-30, 30, 2)
            both = [enlarged(p, eye, middle, shift) for p, eye in zip(pictures, points, strict=True)]
            seen = [one for one, _ in both]
            yield f"{name}, {side}", seen, seen, [eye for _, eye in both]


def recorded(folder: Path) -> Iterator[Clip]:
    for name in ("single_face", "short_human_3blink"):
        labels = load_labels(folder / f"{name}.points.json").frames
        pictures = [picture.copy() for picture in frames(folder / f"{name}.mp4", read=rgb)]
        if name == "short_human_3blink":
            yield name, pictures[::8], [pictures[n] for n in labels], list(labels.values())
            continue
        for start in (0, 9):
            eyes = {n: from_left(points[start : start + 9]) for n, points in labels.items()}
            both = [enlarged(pictures[n], eye, eye, np.zeros(2)) for n, eye in eyes.items()]
            seen = [one for one, _ in both]
            yield f"{name}, eye {1 + start // 9}", seen, seen, [eye for _, eye in both]


def tell(clip: Clip) -> None:
    name, first, pictures, true = clip
    begun = time.perf_counter()
    with open_detector(one_eye=True, first=first) as detector:
        looked = time.perf_counter()
        read = [detector.detect(picture)[0].points for picture in pictures]
        done = time.perf_counter()
    away = np.array([lid_offsets(one, other).mean() for one, other in zip(read, true, strict=True)]) * 100
    markers = default_markers(1)
    gaps = np.array([[inter_eyelid_distances(eye, markers)[0] for eye in eyes] for eyes in (read, true)])
    wide, shut = gaps[1] > 0.6 * gaps[1].max(), gaps[1] < 0.25 * gaps[1].max()
    widest = gaps[0, gaps[1].argmax()] / gaps[1].max()
    sys.stdout.write(
        f"{name:20} {away.mean():.1f}%, open {away[wide].mean():.1f}%, shut {away[shut].mean():.1f}%, "
        f"r = {np.corrcoef(gaps)[0, 1]:.3f}, widest {widest:.3f} of the true; "
        f"looked for {looked - begun:.0f} s, "
        f"read in {(done - looked) / len(pictures) * 1000:.0f} ms\n"
    )
    sys.stdout.flush()


def main() -> None:
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else FOLDER
    faces = int(sys.argv[3]) if len(sys.argv) > 3 else SAMPLE
    for clip in recorded(folder):
        tell(clip)
    if faces:
        for clip in rendered(load_facekit(Path(sys.argv[1])), faces):
            tell(clip)


if __name__ == "__main__":
    main()
