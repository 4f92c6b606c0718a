"""Blink labels of tracked video against the synthetic actor's plan: the table of design/tracking.md.

    python tests/bench/bench_labels.py [seconds of actor a seed, default 90] [folder that keeps the drawings]

Seeds 2, 3 and 4 are drawn, tracked with 20 exactly labelled frames and labelled, both eyes. Truth: 5% of the
amplitude, apex and 95% recovery of the plan, in fractions of a frame at 300 frames/s. Every blink of the plan
is at least 30% deep.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from stimuli_builder.actor.recording import Actor, ActorOptions, Blink, label_points, plan_blinks, write_video
from stimuli_builder.blinks.labelling import PRESETS, LabelOptions, label_blinks
from stimuli_builder.blinks.series import BlinkSeries, read_series
from stimuli_builder.tracking.labels import Labels, save_labels
from stimuli_builder.tracking.learn import learn
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import default_markers
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import scan_video
from tests.bench.bench_blinks import matches
from tests.bench.bench_tracking import print_line

SEEDS = (2, 3, 4)
TARGETS = {"onset": ("5", "3"), "minimum": ("2", "1"), "end": ("15", "8")}

Eye = tuple[list[Blink], BlinkSeries]


def tracked(seconds: float, seed: int, folder: Path) -> list[Eye]:
    """The plan and the tracked distance of each eye; drawn and tracked where the folder has no such track."""
    plan = plan_blinks(seconds, np.random.default_rng([seed, 4]))
    name = f"actor-{seed}-{seconds:g}s"
    track = folder / f"{name}.track.csv"
    if not track.exists():
        actor, video = Actor(ActorOptions(seconds=seconds, seed=seed)), folder / f"{name}.mp4"
        if not video.exists():
            write_video(actor, video, lambda: None)
        info, labels = scan_video(video), folder / f"{name}.labels.json"
        exact = Labels(labels, info.size_px, default_markers(2), label_points(actor, 20, 0.0))
        save_labels(exact, video.name, "bench")
        track_video(learn(info, labels, TrainingOptions(), one_eye=False).model, info, track)
    return [(plan, series) for series in read_series(track)]


def tell(name: str, options: LabelOptions, eyes: list[Eye]) -> None:
    found = [label_blinks(series.distance, series.fps, options) for _, series in eyes]
    errors = np.abs(
        [row for (plan, _), blinks in zip(eyes, found, strict=True) for row in matches(plan, blinks)]
    )
    labelled, true = sum(len(blinks) for blinks in found), sum(len(plan) for plan, _ in eyes)
    print_line(f"preset {name}", "")
    print_line("  precision", f"{len(errors) / labelled:.3f}", "0.98", "1.00")
    print_line("  recall", f"{len(errors) / true:.3f}", "0.98", "0.995")
    for column, (event, targets) in zip(errors.T, TARGETS.items(), strict=True):
        spread = (np.median(column), column.mean(), np.percentile(column, 95))
        line = " | ".join(f"{value:.1f}" for value in spread)
        print_line(f"  {event}, frames: median | mean | 95%", line, *targets)


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 90.0
    with tempfile.TemporaryDirectory() as bare:
        folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(bare)
        folder.mkdir(parents=True, exist_ok=True)
        eyes = [eye for seed in SEEDS for eye in tracked(seconds, seed, folder)]
    print_line(
        f"blink labels, {len(SEEDS)} actors of {seconds:g} s, tracked video", "measured", "must", "aim"
    )
    print_line("blinks of the plan, both eyes", str(sum(len(plan) for plan, _ in eyes)))
    for name, options in PRESETS.items():
        tell(name, options, eyes)


if __name__ == "__main__":
    main()
