"""Which blinks the labelling page chooses, and how near its first points lie: the table of docs/labelling.md.

    python tests/bench/bench_label_choice.py develop|held-out [folder with the real clips]

Every recording is given to the page's own modules (`frontend/scripts/label_choice.mjs`), its frames as small as
the page makes them. A blink counts where one of the chosen frames has the lids half closed or more. Real clips are
those of `../shared/data/face_video`; where they are missing only the actor is measured.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

from tests.bench.label_choice_recordings import CLOSE_UP, FACE, FPS, Recording, actor, walked

ROOT = Path(__file__).parents[2]
LOOKED_PX = 320
Maker = Callable[[], Recording]


def sets(which: str, clips: Path) -> Iterator[tuple[str, list[Maker]]]:
    """Named sets of recordings; seeds of the two parts never meet."""
    first, few, many = (1, 4, 4) if which == "develop" else (101, 10, 7)
    if clips.exists():
        seeds = range(first, first + few)
        yield "whole face, eyes 30 px", [lambda seed=seed: walked(clips, FACE, seed) for seed in seeds]
        yield "close-up of one eye", [lambda seed=seed: walked(clips, CLOSE_UP, seed) for seed in seeds]
        yield "whole face, no blink", [lambda seed=seed: walked(clips, FACE, seed, False) for seed in seeds]
    yield "actor, eyes 30 px", [lambda seed=seed: actor(seed, 0.4) for seed in range(first, first + many)]
    yield "actor, eyes 76 px", [lambda seed=seed: actor(seed, 1.0) for seed in range(first, first + many)]


def chosen_by_page(recording: Recording, folder: Path) -> dict[str, list[float]]:
    """The page's answer: frames chosen, and the corners of the eyes on each, in pixels of the recording."""
    count, height, width = recording.pictures.shape
    small = (LOOKED_PX, max(1, round(LOOKED_PX * height / width)))
    raw = folder / "frames.grey"
    with raw.open("wb") as stream:
        for picture in recording.pictures:
            stream.write(cv2.resize(picture, small, interpolation=cv2.INTER_AREA).tobytes())
    facts = {"frames": count, "fps": FPS, "looked": small, "size": [width, height]}
    command = ["node", "scripts/label_choice.mjs", str(raw), json.dumps(facts)]
    done = subprocess.run(command, cwd=ROOT / "frontend", capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def measured(recording: Recording, folder: Path) -> str:
    answer = chosen_by_page(recording, folder)
    chosen = np.array(answer["chosen"], dtype=int)
    hits = sum(any(first <= frame <= last for frame in chosen) for first, last in recording.blinks)
    return f"{hits}/{len(recording.blinks)} {answer}"


def main(which: str, clips: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, makers in sets(which, clips):
            print(name)
            for make in makers:
                print("  ", measured(make(), Path(folder)))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT.parent / "shared/data/face_video")
