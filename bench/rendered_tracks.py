"""Tracking without labels on rendered faces, against exact lids: how far off, and whether the track knows.

    python -m bench.rendered_tracks KIT.npz [PICTURE.svg]

KIT is ICT-FaceKit's packed file. Eight recordings of 360 frames: two faces, each at
two sizes, and close-ups of four, with a blink every second, a moving head, unsteady light, noise, blur and
compression; every third run of 12 frames is spoilt as in `stated_error.py`. Lids are compared with the
geometry the faces were rendered from: how far off the detector and the track are, r of the lid distance,
the stated error compared with the true one, and how many wrong frames are called `tracked`. PICTURE, where
given, becomes the calibration curve. Nothing is fitted to these recordings. Needs the detector's environment.

Blinks, head and light are those of the synthetic actor (`stimuli_builder.actor.recording`), but for a blink
every second. Each frame is the level of the face whose closure is nearest, so that the geometry it was
rendered from gives the position of its lids; it is moved, turned and scaled by that head, blurred, noisy and
written as H.264.
"""

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from face_baking.kit import load_facekit
from face_baking.training.draw import SamplePose
from face_baking.training.labels import labels_of
from matplotlib.figure import Figure

from bench.recordings import say_lids
from bench.rendered_faces import MIRRORED, AtlasScene, from_left
from bench.stated_error import RUN, SPOILT, Compared, binned, compared, spoilt, tell, tracked_rows
from stimuli_builder.actor.recording import Blink, Course, course, plan_blinks
from stimuli_builder.characters.atlas import SHIPPED, Atlas, load_atlas
from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.tracking.detector.detection import eye_points
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import Points, default_markers, widths
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import numbers, point_columns
from stimuli_builder.video import Picture, VideoWriter, scan_video

SECONDS, FPS = 6.0, 60
CLOSE_UP_PX = 300
TURNED, GROWN = 2.0, 2.0
"""How much more than the actor's a head turns, and comes nearer and goes away."""


@dataclass(frozen=True)
class Look:
    """A face before a camera: the mean width of its eyes in the picture, noise as an sd in gray levels."""

    face: str
    one_eye: bool
    size_px: tuple[int, int]
    eye_px: float
    noise: float
    blur_px: float
    crf: int
    seed: int


LOOKS = (
    Look("alder-face@4", False, (720, 900), 170, 2, 0.5, 18, 11),
    Look("alder-face@4", False, (360, 450), 85, 4, 0.7, 26, 12),
    Look("cedar-face@4", False, (720, 900), 170, 2, 0.5, 18, 13),
    Look("cedar-face@4", False, (240, 300), 55, 4, 0.7, 26, 14),
    Look("alder@8", True, (640, 480), CLOSE_UP_PX, 3, 0.7, 20, 15),
    Look("birch@6", True, (640, 480), CLOSE_UP_PX, 3, 0.7, 26, 16),
    Look("cedar@4", True, (640, 480), CLOSE_UP_PX, 5, 1.0, 20, 17),
    Look("hazel@7", True, (640, 480), CLOSE_UP_PX, 5, 0.7, 26, 18),
)


class RenderedFace:
    """Pictures and lids of a face by the number of its level."""

    def __init__(self, kit, name: str, *, one_eye: bool) -> None:
        self._atlas: Atlas = load_atlas(SHIPPED / name)
        self._scene = AtlasScene(kit, name, self._atlas.size_px)
        self._open = linear_to_srgb(self._atlas.base_linear())
        self._one_eye = one_eye
        self.closures = self._atlas.closures
        self.points = cache(self._points)

    def picture(self, level: int) -> Picture:
        """The whole frame at a level, sRGB."""
        picture = self._open.copy()
        picture[self._atlas.crop] = self._atlas.level_srgb(level)
        return picture

    def _points(self, level: int) -> Points:
        closure = float(self.closures[level])
        eyes = labels_of(self._scene, SamplePose(closure, closure_right=closure))["eyes"]
        curves = [(np.array(eye["upper"]) - 0.5, np.array(eye["lower"]) - 0.5) for eye in eyes.values()]
        read = sorted(
            (from_left(eye_points(upper[::-1], lower)) for upper, lower in curves), key=lambda eye: eye[0, 0]
        )
        return read[0] if self._one_eye else np.concatenate([read[0], read[1][MIRRORED]])


def blinks(seed: int) -> list[Blink]:
    """The first six of the actor's plan, a second apart, so that lids are on their way often."""
    plan = plan_blinks(100, np.random.default_rng([seed, 4]))[: round(SECONDS)]
    return [replace(blink, apex_s=0.4 + second) for second, blink in enumerate(plan)]


def recording(kit, look: Look, folder: Path, spoil=None) -> tuple[Path, dict[int, Points]]:
    """Write a recording and give its file and the points of each frame.

    `spoil(number, picture, points)`, where given, makes another picture of each.
    """
    face = RenderedFace(kit, look.face, one_eye=look.one_eye)
    count = round(SECONDS * FPS)
    now = course(np.arange(count) / FPS, blinks(look.seed), look.seed)
    rng = np.random.default_rng([look.seed, 5])
    scale = look.eye_px / widths(face.points(0))
    middle = face.points(0).mean(axis=0) if look.one_eye else np.array(face.picture(0).shape[1::-1]) / 2
    truth = {}
    path = folder / f"{look.face}-{look.seed}.mp4"
    with VideoWriter(path, FPS, look.size_px, crf=look.crf) as writer:
        for number in range(count):
            level = int(np.abs(face.closures - np.clip(now.closure[number, 0], 0, 1)).argmin())
            matrix = _camera(now, number, scale, middle, look.size_px)
            truth[number] = face.points(level) @ matrix[:, :2].T + matrix[:, 2]
            taken = _taken(face.picture(level), matrix, look, now.light[number], rng)
            writer.write(taken if spoil is None else spoil(number, taken, truth[number]))
    return path, truth


def _camera(now: Course, number: int, scale: float, middle: Points, size_px: tuple[int, int]) -> np.ndarray:
    """The 2 x 3 matrix that takes the face's pixels to the picture's."""
    dx, dy, turn, size = now.head[number]
    cos, sin = np.cos(TURNED * turn), np.sin(TURNED * turn)
    rotation = scale * (1 + GROWN * (size - 1)) * np.array([[cos, -sin], [sin, cos]])
    target = np.array(size_px) / 2 + (dx, dy)
    return np.column_stack([rotation, target - rotation @ middle])


def _taken(
    picture: Picture, matrix: np.ndarray, look: Look, light: float, rng: np.random.Generator
) -> Picture:
    """The picture as the camera has it: smaller sizes are averaged, then come blur, light and noise."""
    shrunk = float(np.linalg.norm(matrix[:, 0]))
    if shrunk < 1:
        picture = cv2.GaussianBlur(picture, (0, 0), 0.5 / shrunk)
    moved = cv2.warpAffine(
        picture, matrix, look.size_px, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    soft = cv2.GaussianBlur(moved, (0, 0), look.blur_px).astype(np.float64)
    noise = rng.normal(0, look.noise, (*soft.shape[:2], 1))
    return np.clip(light * soft + noise, 0, 255).astype(np.uint8)


def recordings(kit, folder: Path, spoil=None) -> Iterator[tuple[Look, Path, dict[int, Points]]]:
    """Every look's recording, one after the other."""
    for look in LOOKS:
        yield (look, *recording(kit, look, folder, spoil))


def every_third_run(number: int, picture: Picture, points: Points) -> Picture:
    """The picture, spoilt in one of four ways where its run of 12 frames is a third one."""
    run = number // RUN
    if run % 3 != 2:
        return picture
    rng = np.random.default_rng([number, 6])
    return spoilt(picture, SPOILT[run // 3 % 4], points, rng)


def tracked_without_labels(path: Path, truth: dict[int, Points], *, one_eye: bool) -> list[Compared]:
    """Stated and true lid error of every frame; prints the lids of the detector and the track on the way."""
    info = scan_video(path)
    seen = survey(info, one_eye=one_eye)
    markers = default_markers(1 if one_eye else 2)
    say_lids("detector", seen.points, truth, markers)
    model = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye).model
    rows = tracked_rows(info, model, seen.hints)
    columns = point_columns(model.eyes)
    given = {n: row for n, row in rows.items() if row["status"] != "lost"}
    points = {n: numbers(row, columns, info.path).reshape(-1, 2) for n, row in given.items()}
    say_lids("track", points, truth, markers)
    return compared(rows, model.eyes, info.path, truth, along=False)


def curve(kinds: dict[str, list[Compared]], path: Path) -> None:
    """Draw stated against true error, by bins of the stated one, with the line of equality."""
    figure = Figure(figsize=(5, 5), layout="constrained")
    axes = figure.subplots()
    for kind, frames in kinds.items():
        known = [frame for frame in frames if frame.status != "lost"]
        stated, true = np.array([f.stated for f in known]), np.array([f.true for f in known])
        bins = [inside for _, _, inside in binned(known)]
        means = [[np.sqrt((values[inside] ** 2).mean()) for inside in bins] for values in (stated, true)]
        axes.plot(*means, "o-", label=f"{kind}, {len(known)} frames")
    end = max(axes.get_xlim()[1], axes.get_ylim()[1])
    axes.plot([0, end], [0, end], color="grey", linewidth=0.8, label="stated = true")
    axes.set(xlabel="stated error, % of the eye's width", ylabel="true error, % of the eye's width")
    axes.legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    kit = load_facekit(Path(sys.argv[1]))
    kinds: dict[str, list[Compared]] = {"whole faces": [], "close-ups": []}
    with tempfile.TemporaryDirectory() as bare:
        for look, path, truth in recordings(kit, Path(bare), every_third_run):
            sys.stdout.write(f"{look.face}, eye {look.eye_px:g} px, CRF {look.crf}\n")
            frames = tracked_without_labels(path, truth, one_eye=look.one_eye)
            tell("  track", frames)
            sys.stdout.flush()
            kinds["close-ups" if look.one_eye else "whole faces"] += frames
    for kind, frames in kinds.items():
        tell(kind, frames)
    tell("together", [frame for frames in kinds.values() for frame in frames])
    if len(sys.argv) > 2:
        curve(kinds, Path(sys.argv[2]))


if __name__ == "__main__":
    main()
