"""Generated recordings of known truth: a rendered face that blinks and moves, in bad light."""

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.colour import linear_to_srgb
from stimuli_builder.clips.characters import find_character, geometry
from stimuli_builder.clips.frames import regions_of
from stimuli_builder.clips.kernels import FULL_SCALE
from stimuli_builder.clips.levels import LevelSet
from stimuli_builder.clips.life import Displacement, EyeRegions, Life, draw_life
from stimuli_builder.tracking.shapes import default_markers, inter_eyelid_distances
from stimuli_builder.tracking.table import track_columns
from stimuli_builder.video import VideoWriter

Values = NDArray[np.float64]
OPENED = np.array(
    [
        (146, 216),
        (182, 191),
        (222, 178),
        (268, 177),
        (304, 198),
        (326, 236),
        (290, 247),
        (244, 252),
        (192, 244),
    ],
    float,
)
"""The lids of the open image-left eye of `alder@8` at 960 x 360 px, and how far down each point closes."""
CLOSES_PX = np.array([0, 47, 67, 69, 45, 0, -3, -6.5, -6], float)


def blink_course(frames: int, fps: float, onsets: tuple[float, ...], depth: float = 1.0) -> Values:
    """Closure of every frame: 100 ms down, 25 ms shut, 250 ms up, in each of the blinks."""
    closure = np.zeros(frames)
    for number, onset in enumerate(onsets):
        since = np.arange(frames) / fps - onset
        down = np.clip(since / 0.1, 0, 1)
        up = np.clip((since - 0.125) / (0.25 + 0.03 * number), 0, 1)
        closure = np.maximum(
            closure, depth * np.minimum(0.5 - 0.5 * np.cos(np.pi * down), (1 - up) ** 2 * (1 + 2 * up))
        )
    return closure


@dataclass
class Recording:
    """A recording to be made; the defaults are a good one."""

    fps: float = 240.0
    seconds: float = 1.1
    width_px: int = 960
    onsets: tuple[float, ...] = (0.1, 0.6)
    depth: float = 1.0
    light: float = 0.04
    noise: float = 1.0
    gaze_mm: float = 0.0
    head_px: Callable[[Values], Values] = field(default=lambda time_s: 0 * time_s)
    readout_s: float = 0.0
    glasses: bool = False
    seed: int = 3
    crf: int = 12
    face: str = "alder@8"
    """Exact landmarks are known of this one alone; a detector sees faces from forehead to chin."""

    @property
    def scale(self) -> float:
        return self.width_px / 960

    @cached_property
    def size_px(self) -> tuple[int, int]:
        width, height = geometry(self.face).size_px
        return self.width_px, 2 * round(self.width_px * height / width / 2)

    @cached_property
    def frame_count(self) -> int:
        return round(self.fps * self.seconds)

    @cached_property
    def closure(self) -> Values:
        return blink_course(self.frame_count, self.fps, self.onsets, self.depth)

    @cached_property
    def character(self) -> LevelSet:
        return find_character(self.face).levels(self.size_px)

    @cached_property
    def regions(self) -> EyeRegions:
        return regions_of(self.character)

    @cached_property
    def life(self) -> Life:
        return draw_life(round(self.seconds * 300) + 2, 1.0, self.seed)

    def _moved(self, frame: int) -> Displacement:
        sample = np.array([min(int(frame / self.fps * 300), len(self.life) - 1)])
        return self.regions.moved_from(self.life, sample, np.ones(1))

    def truth(self, closure: float, frame: int) -> NDArray[np.float32]:
        """(h, w, 3) code values of any closure with all else as in a frame, without noise."""
        weights = self.character.level_weights(np.array([closure]))[0]
        whole = self.character.base.astype(np.float32).copy()
        whole[self.character.window.slices] = sum(
            np.float32(weights[k]) * self.character.levels[k].astype(np.float32)
            for k in np.flatnonzero(weights)
        )
        whole = self.regions.warped(self._looking_aside(whole), self._moved(frame))
        gain = 1 + self.light * np.sin(2 * np.pi * 0.7 * frame / self.fps)
        picture = linear_to_srgb(whole * np.float32(gain / FULL_SCALE)).astype(np.float32)
        if self.glasses:
            _draw_glasses(picture, self.scale)
        return self._shaken(picture, frame)

    def _looking_aside(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Both irises moved to the right with what is around them."""
        if not self.gaze_mm:
            return picture
        y, x = np.mgrid[0 : picture.shape[0], 0 : picture.shape[1]].astype(np.float32)
        shift = np.zeros_like(x)
        for middle_x, middle_y in self.regions.pupils_px:
            away = np.hypot(x - middle_x, y - middle_y) / (10 * self.regions.px_per_mm)
            shift += (self.gaze_mm * self.regions.px_per_mm * np.exp(-(away**6))).astype(np.float32)
        return np.asarray(cv2.remap(picture, x - shift, y, cv2.INTER_CUBIC), np.float32)

    def _shaken(self, picture: NDArray[np.float32], frame: int) -> NDArray[np.float32]:
        height, width = picture.shape[:2]
        rows_s = frame / self.fps + self.readout_s * np.arange(height) / height
        shift = self.head_px(rows_s)
        if not np.any(shift):
            return picture
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        return np.asarray(
            cv2.remap(
                picture,
                x - shift[:, None].astype(np.float32),
                y,
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_REFLECT_101,
            ),
            np.float32,
        )

    def pictures(self) -> Iterator[NDArray[np.uint8]]:
        rng = np.random.default_rng(self.seed)
        for frame, closure in enumerate(self.closure):
            picture = self.truth(float(closure), frame)
            picture = picture + np.float32(self.noise) * rng.standard_normal(picture.shape, np.float32)
            yield np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    def points(self, frame: int) -> Values:
        """(18, 2) exact landmarks of a frame."""
        eye = OPENED + np.c_[np.zeros(9), self.closure[frame] * CLOSES_PX]
        other = np.c_[948 - eye[:, 0], eye[:, 1]]
        head = self.head_px(np.array([frame / self.fps + self.readout_s * 0.6]))[0]
        moved = self._moved(frame)
        return np.concatenate([eye, other]) * self.scale + moved.head_px + [head, 0]

    def write(self, folder: Path, name: str = "person") -> tuple[Path, Path]:
        """Write video and track; returns both paths."""
        video, track = folder / f"{name}.mp4", folder / f"{name}.csv"
        write_video(video, self.pictures(), self.fps, self.crf)
        self.write_track(track)
        return video, track

    def write_close_up(self, path: Path) -> Path:
        """Write a video of 56 x 42 mm about the image-left eye."""
        middle_x, middle_y = self.regions.pupils_px[0]
        width, height = (2 * round(half_mm * self.regions.px_per_mm) for half_mm in (28, 21))
        x = max(0, round(middle_x) - width // 2)
        y = min(max(0, round(middle_y) - height // 2), self.size_px[1] - height)
        shown = (picture[y : y + height, x : x + width] for picture in self.pictures())
        return write_video(path, shown, self.fps, self.crf)

    def write_track(self, path: Path) -> Path:
        with path.open("w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(track_columns(2))
            for frame in range(self.frame_count):
                points = self.points(frame)
                distances = inter_eyelid_distances(points, default_markers(2))
                cells = [f"{value:.3f}" for value in (*points.ravel(), *distances)]
                writer.writerow(
                    [frame, f"{frame / self.fps:.6f}", *cells, 1, 1, 0.5, *[0.5] * 18, "tracked", ""]
                )
        return path


def write_video(path: Path, pictures: Iterator[NDArray[np.uint8]], fps: float, crf: int) -> Path:
    """Encode pictures of one size."""
    first = next(pictures)
    with VideoWriter(path, fps, (first.shape[1], first.shape[0]), crf=crf) as writer:
        for picture in chain([first], pictures):
            writer.write(np.ascontiguousarray(picture))
    return path


def _draw_glasses(picture: NDArray[np.float32], scale: float) -> None:
    """Rims, and a window's reflection that hides part of each eye."""
    for x in (236, 712):
        middle = (round(x * scale), round(215 * scale))
        axes = (round(130 * scale), round(95 * scale))
        cv2.ellipse(picture, middle, axes, 0, 0, 360, (30, 30, 30), max(2, round(8 * scale)))
        corner = (round((x - 40) * scale), round(195 * scale))
        cv2.rectangle(
            picture,
            corner,
            (corner[0] + round(24 * scale), corner[1] + round(40 * scale)),
            (250, 250, 250),
            -1,
        )
