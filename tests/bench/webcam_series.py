"""Hand-labelled webcam series for bench_lid_events.py, from a published evaluation on eyeblink8.

    python tests/bench/webcam_series.py FOLDER OUT

FOLDER is `original_svm` of github.com/QuangPham2404/Blink-Detection-Using-Adaptive-Eye-Aspect-Ratio (commit
3fd1191): `ear1.txt` to `ear8.txt` are the mean eye aspect ratio of both eyes by MediaPipe's face mesh with
refined lids, a frame of eyeblink8's eight videos a line; `zzz_target.txt` holds, a video a line, 1 where
eyeblink8's people labelled a blink. Writes one CSV a video: frame, ear, tag.

Some label lists lack frames that the series have (up to 90, in one or two places). The place is told by the
series itself: labels are shifted by what makes the aspect ratio lowest within the labelled blinks, shifts
never decrease, and a change costs as much as 0.3 of an open eye. No classifier takes part.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.times import runs

CHANGE = 0.3
OPEN_FRAMES = 151


def relative(ear: Array) -> Array:
    """Aspect ratio against the upper fifth of the five seconds about each frame."""
    series = pd.Series(ear).interpolate(limit_direction="both")
    return (series / series.rolling(OPEN_FRAMES, center=True, min_periods=1).quantile(0.8)).to_numpy()


def shifts(ear: Array, blinks: list[tuple[int, int]], lacking: int) -> list[int]:
    """Frames by which each labelled blink lies later in the series, by dynamic programming."""
    level, places = relative(ear), np.arange(lacking + 3)
    cost = np.array(
        [
            [
                min(1.0, level[np.clip(np.arange(start, end) + s, 0, ear.size - 1)].mean())
                for s in places.tolist()
            ]
            for start, end in blinks
        ]
    )
    change = np.where(places[:, None] > places, np.inf, CHANGE * (places[:, None] != places))
    total, origins = cost[0], []
    for row in cost[1:]:
        paths = total[:, None] + change
        origins.append(paths.argmin(0))
        total = row + paths.min(0)
    chosen = [int(total.argmin())]
    for origin in reversed(origins):
        chosen.append(int(origin[chosen[-1]]))
    return chosen[::-1]


def labelled(ear: Array, target: Array) -> pd.DataFrame:
    """Frame, aspect ratio (0 where no face was seen) and tag ('0' outside blinks) of one video."""
    blinks = list(runs(target > 0))
    tags = np.full(ear.size, "0")
    moved = shifts(ear, blinks, max(0, ear.size - target.size))
    for number, ((start, end), shift) in enumerate(zip(blinks, moved, strict=True)):
        tags[start + shift : end + shift] = str(number % 9 + 1)
    return pd.DataFrame({"frame": np.arange(ear.size), "ear": np.nan_to_num(ear), "tag": tags})


def main() -> None:
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    lines = (folder / "zzz_target.txt").read_text(encoding="utf-8").strip().splitlines()
    for number, line in enumerate(lines, 1):
        texts = (folder / f"ear{number}.txt").read_text(encoding="utf-8").split()
        ear = np.array([np.nan if text == "None" else float(text) for text in texts])
        table = labelled(ear, np.array(line.split(), int))
        table.to_csv(out / f"eyeblink8-{number}.csv", index=False)
        sys.stdout.write(f"eyeblink8-{number}.csv: {len(table)} frames\n")


if __name__ == "__main__":
    main()
