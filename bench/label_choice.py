"""Which blinks the labeling page chooses, and how near its first points are (docs/how-to/label-frames.md).

    python -m bench.label_choice develop|held-out [folder with the real clips]

Every recording is given to the page's own modules (`frontend/scripts/label_choice.mjs`), its frames as small
as the page makes them. A blink counts where one of the chosen frames has the lids half closed or more. Real
clips are those of `../shared/data/face_video`; where they are missing only the actor is measured.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from bench.harness import RECORDINGS, ROOT, print_line
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
    position, way, crossing = float(rng.uniform(0, clip.closed[0][0] - 9)), 1.0, False
    for number in range(int(SECONDS * FPS)):
        ahead = position + way * clip.step
        if not any(first - 6 <= ahead <= end + 10 for first, end in clip.closed):
            crossing = False
        elif not crossing and due and number >= due[0]:
            due.pop(0)
            crossing = True
        elif not crossing:
            way = -way
        if not 0 <= position + way * clip.step <= last:
            way = -way
        position += way * clip.step
        yield round(position), crossing


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


LOOKED_PX = 320
SEEDS = {"develop": (range(1, 4), range(1, 4)), "held-out": (range(101, 111), range(101, 108))}


@dataclass(frozen=True)
class Set:
    """Recordings of one kind, and how many eyes the page looks for."""

    name: str
    eyes: int
    makers: list[Callable[[], Recording]]


@dataclass(frozen=True)
class Answer:
    """What the page's modules say: frames chosen now and without eyes, and where eyes are on candidates."""

    chosen: list[int]
    before: list[int]
    candidates: list[int]
    places: list[dict[str, Any]]
    seconds: float


def sets(which: str, clips: Path) -> Iterator[Set]:
    """The seeds of development and those held out never meet; the real clips are the same two people."""
    real, drawn = SEEDS[which]
    if clips.exists():
        faces = [partial(walked, clips, FACE, seed) for seed in real]
        near = [partial(walked, clips, CLOSE_UP, seed) for seed in real]
        yield Set("whole face, eyes 30 px wide", 2, faces)
        yield Set("close-up, one eye chosen", 1, near)
        yield Set("close-up, two eyes chosen", 2, near)
        yield Set("whole face, no blink", 2, [partial(walked, clips, FACE, seed, False) for seed in real])
    yield Set("actor, eyes 30 px wide", 2, [partial(actor, seed, 0.4) for seed in drawn])
    yield Set("actor, eyes 76 px wide", 2, [partial(actor, seed, 1.0) for seed in drawn])


def answer_of(recording: Recording, eyes: int, folder: Path) -> Answer:
    """The answer for one recording, its frames made as small as the page makes them."""
    count, height, width = recording.pictures.shape
    small = (LOOKED_PX, max(1, round(LOOKED_PX * height / width)))
    raw = folder / "frames.grey"
    with raw.open("wb") as stream:
        for picture in recording.pictures:
            stream.write(cv2.resize(picture, small, interpolation=cv2.INTER_AREA).tobytes())
    facts = {"frames": count, "fps": FPS, "looked": small, "size": [width, height], "eyes": eyes}
    command = ["node", "scripts/label_choice.mjs", str(raw), json.dumps(facts)]
    done = subprocess.run(command, cwd=ROOT / "frontend", capture_output=True, text=True, check=True)
    return Answer(**json.loads(done.stdout.splitlines()[-1]))


def hits(frames: list[int], recording: Recording) -> int:
    """Blinks of which a frame with the lids half closed or more is among those given."""
    return sum(any(first <= frame <= last for frame in frames) for first, last in recording.blinks)


def errors(answer: Answer, recording: Recording) -> list[float]:
    """Distance of each eye's middle from the truth on every candidate frame, in widths of the eye."""
    distances = []
    for number, eyes in zip(answer.candidates, answer.places, strict=False):
        for eye, centre in enumerate(eyes["centres"]):
            first, last = recording.canthi[number, 2 * eye : 2 * eye + 2]
            distances.append(float(np.hypot(*(centre - (first + last) / 2)) / np.hypot(*(last - first))))
    return distances


def measure(kind: Set, folder: Path) -> tuple[str, str]:
    """One line of the table: its name and its figures."""
    blinks = now = before = seen = 0
    distances: list[float] = []
    seconds: list[float] = []
    for make in kind.makers:
        recording = make()
        answer = answer_of(recording, kind.eyes, folder)
        blinks += len(recording.blinks)
        now += hits(answer.chosen, recording)
        before += hits(answer.before, recording)
        seen += bool(answer.places)
        seconds.append(answer.seconds)
        if answer.places and recording.canthi.shape[1] == 2 * kind.eyes:
            distances += errors(answer, recording)
    off = np.percentile(distances, [50, 95, 100]).round(2).tolist() if distances else "-"
    return (
        kind.name,
        f"blinks {before} -> {now} of {blinks}; eyes found in {seen} of {len(kind.makers)}; "
        f"off by (median, 95%, worst; eye widths) {off}; {max(seconds):.1f} s of processor",
    )


def main(which: str, clips: Path) -> None:
    """Measure every set and print a line for each."""
    with tempfile.TemporaryDirectory() as folder:
        for kind in sets(which, clips):
            print_line(*measure(kind, Path(folder)))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / RECORDINGS)
