"""How fast real recordings are tracked compared with an earlier revision, in turns, from the same models.

    python -m bench.track_speed [FOLDER] [REVISION, df3da2d] [rounds, 5]

FOLDER (../shared/data/face_video) holds the recordings. A model and detections of each are made once, without
labels; both revisions track with them, a detection at every frame or every 10th. Fit only is processor time
of one thread; end to end is wall-clock time with decoding and writing, and processor time of all threads; the
best round counts. `differ` is the furthest a point lies from where the earlier revision put it, and how many
frames have another status. Needs the detector's environment, made at first use.
"""

import json
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from bench.harness import RECORDINGS, ROOT, earlier_tree, figures_of
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.tracking.track import track_video

try:
    from stimuli_builder.tracking.model import TrainingOptions, load_model, save_model
    from stimuli_builder.tracking.survey import survey
    from stimuli_builder.video import scan_video
except ModuleNotFoundError:  # an earlier revision, which has them in one file
    from stimuli_builder.tracking.labelfree import survey
    from stimuli_builder.tracking.model import TrainingOptions, load_model, save_model
    from stimuli_builder.video import scan_video

CLIPS = {"single_face": False, "short_human_3blink": True}
EVERY = (1, 10)


def prepare(folder: Path, models: Path) -> None:
    """Save the model and the detections of each recording."""
    for name, one_eye in CLIPS.items():
        info = scan_video(folder / f"{name}.mp4")
        seen = survey(info, one_eye=one_eye)
        lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye)
        save_model(lesson.model, models / f"{name}.npz")
        np.savez(models / f"{name}.seen.npz", frames=list(seen.points), points=list(seen.points.values()))


def measure(folder: Path, models: Path, out: Path) -> dict[str, list[float]]:
    """Frames a second of one revision: fit only, end to end by wall clock and by processor time."""
    speeds = {}
    for name in CLIPS:
        info, model = scan_video(folder / f"{name}.mp4"), load_model(models / f"{name}.npz")
        with np.load(models / f"{name}.seen.npz") as stored:
            seen = dict(zip(stored["frames"].tolist(), stored["points"], strict=True))
        for every in EVERY:
            hints = {frame: points for frame, points in seen.items() if frame % every == 0}
            track = out / f"{name}-{every}.csv"
            track_video(model, info, track, None, hints)
            wall, processor = time.perf_counter(), time.process_time()
            summary = track_video(model, info, track, None, hints)
            wall, processor = time.perf_counter() - wall, time.process_time() - processor
            count = info.frame_count
            speeds[f"{name}, detection every {every}"] = [summary.fit_fps, count / wall, count / processor]
    return speeds


def one_round(tree: Path, folder: Path, models: Path, out: Path) -> dict[str, list[float]]:
    """A round of one revision in a separate process."""
    out.mkdir(exist_ok=True)
    speeds: dict[str, list[float]] = figures_of(tree, __file__, folder.resolve(), models, out)
    return speeds


def differences(before: Path, after: Path) -> tuple[float, int]:
    """Furthest distance of a point in px, and number of frames whose status differs, between two tracks."""
    furthest, others = 0.0, 0
    for one, two in zip(track_rows(before), track_rows(after), strict=True):
        names = point_columns(1 if "x18" not in one else 2)
        others += one["status"] != two["status"]
        moves = numbers(one, names, "before") - numbers(two, names, "after")
        furthest = max(furthest, float(np.nan_to_num(np.hypot(*moves.reshape(-1, 2).T)).max()))
    return furthest, others


def best(rounds: list[dict[str, list[float]]], name: str) -> list[float]:
    return np.max([one[name] for one in rounds], axis=0).tolist()


def main(folder: str = str(RECORDINGS), revision: str = "df3da2d", rounds: str = "5") -> None:
    if not all((Path(folder) / f"{name}.mp4").exists() for name in CLIPS):
        sys.stdout.write(f"speed on recordings: not in {folder}, left out\n")
        return
    with tempfile.TemporaryDirectory() as temporary, earlier_tree(revision) as old:
        bare = Path(temporary)
        models = bare / "models"
        models.mkdir()
        prepare(Path(folder), models)
        before, after = [], []
        for _ in range(int(rounds)):
            before.append(one_round(old, Path(folder), models, bare / "before"))
            after.append(one_round(ROOT, Path(folder), models, bare / "after"))
        load = " ".join(f"{part:.1f}" for part in os.getloadavg())
        sys.stdout.write(f"frames/s, {revision} -> here (ratio); load {load}\n")
        for name in before[0]:
            parts = [
                f"{what} {then:,.0f} -> {now:,.0f} ({now / then:.2f})"
                for what, then, now in zip(
                    ("fit", "wall", "processor"), best(before, name), best(after, name), strict=True
                )
            ]
            file = f"{name.replace(', detection every ', '-')}.csv"
            furthest, others = differences(bare / "before" / file, bare / "after" / file)
            sys.stdout.write(f"{name}: {'; '.join(parts)}; differ {furthest:.3f} px, {others} statuses\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["measure"]:
        sys.stdout.write(json.dumps(measure(*map(Path, sys.argv[2:]))) + "\n")
    else:
        main(*sys.argv[1:])
