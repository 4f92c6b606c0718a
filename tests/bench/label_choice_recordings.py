"""Recordings with known blinks for `bench_label_choice.py`: real clips walked to and fro, and the actor."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.actor.face import PICTURE_SIZE
from stimuli_builder.actor.recording import Actor, ActorOptions, truth_points

Pictures = NDArray[np.uint8]
Points = NDArray[np.float64]

FPS = 30.0
SECONDS = 60
BLINKS = 8
HALF_CLOSED = 0.5
BACKGROUND_SIZE = (640, 360)


@dataclass(frozen=True)
class Clip:
    """A real clip: its frames with lids half closed or more; its frames to one of 30 a second."""

    name: str
    step: float
    closed: tuple[tuple[int, int], ...]
    canthi: tuple[int, ...]


FACE = Clip("single_face", 1.0, ((26, 30),), (0, 5, 14, 9))
CLOSE_UP = Clip("short_human_3blink", 2.6, ((18, 34), (133, 146), (206, 215)), (0, 5))


@dataclass(frozen=True)
class Recording:
    """What the choice is measured on.

    Attributes
    ----------
    pictures : array of uint8, frames x height x width
        Luminance.
    blinks : list of (first, last)
        Frames, half closed or more, of each blink.
    canthi : array of float, frames x (2 or 4) x 2
        Left and right corner of each eye in the picture, in pixels; NaN where not known.
    """

    name: str
    pictures: Pictures
    blinks: list[tuple[int, int]]
    canthi: Points = field(repr=False)


def luminance(path: Path) -> Pictures:
    """Every frame, frames x height x width."""
    with av.open(str(path)) as video:
        return np.stack([frame.to_ndarray(format="gray") for frame in video.decode(video=0)])


def _walk(clip: Clip, count: int, rng: np.random.Generator, with_blinks: bool) -> Iterator[tuple[int, bool]]:
    """Frame of the clip at each time, and whether a blink passes: to and fro, through a blink when due."""
    spacing = SECONDS * FPS / BLINKS
    due = [spacing * (blink + rng.uniform(0.15, 0.85)) for blink in range(BLINKS)] if with_blinks else []
    last = count - 1
    place, way, crossing = float(rng.uniform(0, clip.closed[0][0] - 9)), 1.0, False
    for number in range(int(SECONDS * FPS)):
        ahead = place + way * clip.step
        if not any(first - 6 <= ahead <= end + 10 for first, end in clip.closed):
            crossing = False
        elif not crossing and due and number >= due[0]:
            due.pop(0)
            crossing = True
        elif not crossing:
            way = -way
        if not 0 <= place + way * clip.step <= last:
            way = -way
        place += way * clip.step
        yield round(place), crossing


def walked(folder: Path, clip: Clip, seed: int, with_blinks: bool = True) -> Recording:
    """A minute of a real clip, to and fro without a cut, with eight blinks at times drawn by `seed`."""
    frames = luminance(folder / f"{clip.name}.mp4")
    labels = json.loads((folder / f"{clip.name}.points.json").read_text())["frames"]
    known = np.array(sorted(int(number) for number in labels))
    corners = np.array(
        [[labels[str(number)][point] for point in clip.canthi] for number in known], dtype=float
    )
    course = list(_walk(clip, len(frames), np.random.default_rng([seed, 24]), with_blinks))
    indices = np.array([index for index, _ in course])
    closed = [any(first <= index <= last for first, last in clip.closed) for index in indices]
    flat = corners.reshape(len(known), -1).T
    canthi = np.stack([np.interp(indices, known, values) for values in flat], axis=1)
    rng = np.random.default_rng([seed, 25])
    noise = np.round(rng.normal(0, 1.0, size=(8, *frames.shape[1:]))).astype(np.int16)
    pictures = np.empty((len(indices), *frames.shape[1:]), np.uint8)
    for number, index in enumerate(indices):
        pictures[number] = np.clip(frames[index] + noise[rng.integers(8)], 0, 255)
    return Recording(f"{clip.name}-{seed}", pictures, spans(closed), canthi.reshape(len(indices), -1, 2))


def spans(flags: list[bool]) -> list[tuple[int, int]]:
    """First and last of each run of true flags."""
    edges = np.flatnonzero(np.diff([False, *flags, False]))
    return [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]


def actor(seed: int, scale: float) -> Recording:
    """The actor up to its eighth blink that half closes; below scale 1 shrunk, before an uneven wall."""
    drawn = Actor(ActorOptions(seconds=SECONDS, fps=FPS, seed=seed))
    closed = spans([bool(both.mean() >= HALF_CLOSED) for both in drawn.course.closure])[:BLINKS]
    count = min(drawn.options.frame_count, closed[-1][1] + 30)
    rng = np.random.default_rng([seed, 26])
    points = np.stack(list(truth_points(drawn.course))[:count])[:, FACE.canthi]
    faces = [drawn.frame(number)[0] for number in range(count)]
    if scale == 1:
        return Recording(f"actor-{seed}", np.stack(faces), closed, points)
    width, height = BACKGROUND_SIZE
    small = (round(PICTURE_SIZE[0] * scale), round(PICTURE_SIZE[1] * scale))
    at = np.array([rng.integers(width - small[0]), rng.integers(height - small[1])])
    wall = cv2.resize(rng.uniform(40, 200, (9, 16)).astype(np.float32), BACKGROUND_SIZE)
    pictures = np.empty((count, height, width), np.uint8)
    for number, face in enumerate(faces):
        scene = wall.copy()
        inner = cv2.resize(face, small, interpolation=cv2.INTER_AREA)
        scene[at[1] : at[1] + small[1], at[0] : at[0] + small[0]] = inner
        pictures[number] = np.clip(scene + rng.normal(0, 1.5, scene.shape), 0, 255)
    return Recording(f"actor-{seed}-{scale:g}", pictures, closed, (points + 0.5) * scale - 0.5 + at)
