"""Rendered faces, whose geometry is known: how exact irises are, and the lids of one eye in a close-up.

    python -m bench.rendered_faces iris KIT.npz [every, 8]
    python -m bench.rendered_faces close-up KIT.npz [FOLDER] [FACES, 2]
    python -m bench.rendered_faces sheet RECORDING.mp4 OUT.webp NAME ...

iris: KIT is ICT-FaceKit's packed file. The lids' points are the true ones with 1.5% of
the eye's width of noise. Errors in percent of the eye's width (middle) and of the true diameter.

close-up: KIT is ICT-FaceKit's packed file. Each eye of the rendered faces that ship,
at nine closures, and of FOLDER's single_face (../shared/data/face_video; labels good to 3 to 6%) is
enlarged to 416 px of a picture of 640 x 480; FOLDER's short_human_3blink is a close-up. Mean distance of
the lids from the true ones in percent of the eye's width: of all pictures, of those open, of those shut;
correlation of the lid distance; height of the widest opening compared with the true one; and how long the eye
was looked for and read. FACES are so many of the rendered faces (6 at most, 0: recordings alone): two are a
sample, since all six did not end within an hour on two busy cores. The recordings come first, and each line
is printed as soon as it is known. Needs the detector's environment, made at first use.

sheet: draws the left eye of some characters next to a real one at the same size, at four closures.
RECORDING is tests/testdata/short_human_3blink.mp4 of https://github.com/simonarvin/eyeloop (commit
cd22fb7, GPL-3.0), whose license allows pictures of its frames with credit and a link.
"""

import sys
import time
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
from PIL import Image

from bench.harness import RECORDINGS, run_part
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.clips.characters import find_character
from stimuli_builder.tracking.certainty import lid_offsets
from stimuli_builder.tracking.detector.detection import eye_points
from stimuli_builder.tracking.detector.mesh import open_detector
from stimuli_builder.tracking.iris import measure_iris
from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.shapes import Points, default_markers, inter_eyelid_distances, widths
from stimuli_builder.video import Picture, frames, rgb

FACES = ("alder@8", "birch@6", "cedar@4", "hazel@7", "alder-face@4", "cedar-face@4")
NOISE = 0.015
SEEN = ((0.0, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 1.01))


class AtlasScene(SampleScene):
    """The scene that a shipped face was rendered from."""

    def __init__(self, kit, name: str, size_px: tuple[int, int]) -> None:
        identity, _, framing = name.partition("@")[0].partition("-")
        FaceScene.__init__(self, kit, load_identity(identity), framing or "eyes", size_px)


def rendered_eyes(name: str, kit, every: int) -> Iterator[tuple]:
    """Gray picture and labels of each eye at every n-th closure of a face."""
    atlas = load_atlas(SHIPPED / name)
    scene = AtlasScene(kit, name, atlas.size_px)
    picture = linear_to_srgb(atlas.base_linear())
    for number in range(0, len(atlas.closures), every):
        picture[atlas.crop] = atlas.level_srgb(number)
        closure = float(atlas.closures[number])
        labels = labels_of(scene, SamplePose(closure, closure_right=closure))
        for eye in labels["eyes"].values():
            yield cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), eye


def iris_errors(picture, eye: dict, rng: np.random.Generator) -> tuple[float, float, float] | None:
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


def measure_irises() -> None:
    kit, every = load_facekit(Path(sys.argv[1])), int(sys.argv[2]) if len(sys.argv) > 2 else 8
    rng = np.random.default_rng(1)
    pairs = [
        (eye["iris"]["visible"], iris_errors(picture, eye, rng))
        for name in FACES
        for picture, eye in rendered_eyes(name, kit, every)
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


def rendered_close_ups(kit, faces: int) -> Iterator[Clip]:
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


def recorded_close_ups(folder: Path) -> Iterator[Clip]:
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


def say_close_up(clip: Clip) -> None:
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


def measure_close_ups() -> None:
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else RECORDINGS
    faces = int(sys.argv[3]) if len(sys.argv) > 3 else SAMPLE
    for clip in recorded_close_ups(folder):
        say_close_up(clip)
    if faces:
        for clip in rendered_close_ups(load_facekit(Path(sys.argv[1])), faces):
            say_close_up(clip)


REAL_CLOSURES = {0.0: 60, 0.35: 216, 0.6: 32, 1.0: 26}
"""Frames of the recording by closure, from its labels: 0, 0.34, 0.60 and 0.98."""
REAL_MIDDLE_PX, REAL_PX_PER_MM = (349, 259), 16.4
"""Middle of the open iris and size, from the iris' outline: 11.7 mm wide."""
TILE_MM, TILE_PX_PER_MM, EYE_ABOVE_MM = (36.0, 22.0), 10.0, 4.3


def cut_tile(picture: Picture, middle_px: tuple[float, float], px_per_mm: float) -> Picture:
    """The picture about an eye, TILE_MM wide and high."""
    scale = TILE_PX_PER_MM / px_per_mm
    size = tuple(round(mm * TILE_PX_PER_MM) for mm in TILE_MM)
    away = np.array(size) / 2 - scale * np.array(middle_px)
    matrix = np.array([[scale, 0, away[0]], [0, scale, away[1]]])
    flags = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
    return np.asarray(cv2.warpAffine(picture, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE))


def eye_column(name: str) -> list[Picture]:
    """The left eye of a character at each closure."""
    character = find_character(name)
    declared = character.geometry
    levels, (width, height) = character.levels(declared.size_px), declared.size_px
    scale = declared.px_per_mm
    middle = width / 2 + declared.inter_ocular_mm / 2 * scale, height / 2 + EYE_ABOVE_MM * scale
    return [cut_tile(levels.picture(closure), middle, scale) for closure in REAL_CLOSURES]


def draw_sheet() -> None:
    recording, out, names = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]
    shown = {n: picture.copy() for n, picture in enumerate(frames(recording, read=rgb))}
    real = [cut_tile(shown[n], REAL_MIDDLE_PX, REAL_PX_PER_MM) for n in REAL_CLOSURES.values()]
    columns = [np.vstack(column) for column in (real, *map(eye_column, names))]
    Image.fromarray(np.hstack(columns)).save(out, quality=75, method=6)


PARTS = {
    "sheet": draw_sheet,
    "iris": measure_irises,
    "close-up": measure_close_ups,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
