"""Tracking in changing light: the actor's recordings made darker, brighter, flatter and unsteady.

    python tests/bench/bench_light.py

Two recordings of 300 frames, 20 exact labels each in even light. Prints frames tracked and lost, the points'
error, and frames off by more than 5% of the eye's width.
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from stimuli_builder.actor.recording import Actor, ActorOptions, label_points, write_truth, write_video
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import learn
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions
from stimuli_builder.tracking.shapes import Points, default_markers, widths
from stimuli_builder.tracking.tracker import Tracker
from stimuli_builder.video import Picture, frames, scan_video

SEEDS = (11, 12)
CHANGES: dict[str, Callable[[int], tuple[float, float]]] = {
    "even light": lambda _: (1.0, 0.0),
    "fades to 60%": lambda n: (1 - 0.4 * n / 300, 0.0),
    "swings by 30%": lambda n: (1 + 0.3 * np.sin(n / 15), 0.0),
    "70% from a frame on": lambda n: (0.7 if n > 100 else 1.0, 0.0),
    "flickers by 8%": lambda n: (1 + 0.08 * np.sin(2.1 * n), 0.0),
    "luminance 16 to 235": lambda _: (219 / 255, 16.0),
    "70% of the contrast": lambda _: (0.7, 40.0),
    "a quarter brighter": lambda _: (1.25, 0.0),
}


def recorded(folder: Path, seed: int) -> tuple[list[Picture], Points, CoupledModel]:
    """Pictures, exact points (frames, 18, 2) and a model of one recording."""
    actor = Actor(ActorOptions(seconds=3.0, fps=100, seed=seed))
    video, truth, labels = (folder / f"{seed}{end}" for end in (".mp4", ".csv", ".json"))
    write_video(actor, video, lambda: None)
    write_truth(actor, truth)
    save_labels(
        Labels(labels, (512, 384), default_markers(2), label_points(actor, 20, 0.0)), video.name, "actor"
    )
    lesson = learn(scan_video(video), labels, TrainingOptions(), one_eye=False, refine=False)
    points = np.loadtxt(truth, delimiter=",", skiprows=1, usecols=range(2, 38)).reshape(-1, 18, 2)
    return list(frames(video)), points, lesson.model


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        recordings = [recorded(Path(folder), seed) for seed in SEEDS]
    for name, change in CHANGES.items():
        away, lost = [], 0
        for pictures, points, model in recordings:
            tracker = Tracker(model)
            for number, (picture, true) in enumerate(zip(pictures, points, strict=True)):
                gain, offset = change(number)
                changed = np.clip(np.rint(gain * picture.astype(np.float32) + offset), 0, 255)
                frame = tracker.step(changed.astype(np.uint8))
                lost += frame.points is None
                if frame.points is not None:
                    away.append((np.sqrt(((frame.points - true) ** 2).sum(1).mean()), widths(true)))
        far = np.array(away).reshape(-1, 2)
        sys.stdout.write(
            f"{name:20} {lost} of {lost + len(far)} lost, RMS {np.sqrt((far[:, 0] ** 2).mean()):.3f} px, "
            f"{int((far[:, 0] > 0.05 * far[:, 1]).sum())} more than 5% off\n"
        )


if __name__ == "__main__":
    main()
