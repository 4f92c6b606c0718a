"""Which blinks the labelling page chooses, and how near its first points lie: the table of docs/labelling.md.

    PYTHONPATH=. python tests/bench/bench_label_choice.py develop|held-out [folder with the real clips]

Every recording is given to the page's own modules (`frontend/scripts/label_choice.mjs`), its frames as small
as the page makes them. A blink counts where one of the chosen frames has the lids half closed or more. Real
clips are those of `../shared/data/face_video`; where they are missing only the actor is measured.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.bench.bench_tracking import print_line
from tests.bench.label_choice_recordings import CLOSE_UP, FACE, FPS, Recording, actor, walked

ROOT = Path(__file__).parents[2]
LOOKED_PX = 320
SEEDS = {"develop": (range(1, 4), range(1, 4)), "held-out": (range(101, 111), range(101, 108))}


@dataclass(frozen=True)
class Set:
    """Recordings of one kind, and how many eyes the page is told to look for."""

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
    found = []
    for number, eyes in zip(answer.candidates, answer.places, strict=False):
        for eye, centre in enumerate(eyes["centres"]):
            first, last = recording.canthi[number, 2 * eye : 2 * eye + 2]
            found.append(float(np.hypot(*(centre - (first + last) / 2)) / np.hypot(*(last - first))))
    return found


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
    given = sys.argv[2] if len(sys.argv) > 2 else ROOT.parent / "shared" / "data" / "face_video"
    main(sys.argv[1], Path(given))
