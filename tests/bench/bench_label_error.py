"""What labels allow: lids on frames left out, and what a perfect tracker would correlate with them.

    python tests/bench/bench_label_error.py [FOLDER]

FOLDER (../shared/data/face_video) holds NAME.mp4 and NAME.points.json. Trained without a fifth of
the labels, five times, points and lids (distance of lid points from the labelled lid's curve: a point's way
along the lid is no error) are compared with those left out. Then the labels are taken for the truth, and
other labels with so many pixels of error across the lid for each point (independent of one another) are
correlated with it in their lid distances, as `bench_label_free.py` does with the track's.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from stimuli_builder.tracking.accuracy import cross_validate
from stimuli_builder.tracking.certainty import lid_offsets
from stimuli_builder.tracking.labels import Labels, load_labels
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import inter_eyelid_distances
from stimuli_builder.video import read_frames, scan_video

FOLDER = Path("../shared/data/face_video")
CLIPS = ("single_face", "short_human_3blink")
ERRORS_PX = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0)
DRAWN = 500


def tell_left_out(folder: Path, name: str, labels: Labels) -> None:
    """Print the error on frames left out of training: points and lid distance."""
    info = scan_video(folder / f"{name}.mp4")
    pictures = read_frames(info, list(labels.frames))
    results = cross_validate(pictures, labels.frames, labels.markers, TrainingOptions(), 5)
    measured = [one for one in results if one.rms_px is not None]
    points = np.sqrt(np.mean([(one.rms_px / one.width_px) ** 2 for one in measured]))
    away = [np.mean(lid_offsets(one.points, labels.frames[one.frame])) for one in measured]
    gaps = np.concatenate([one.distance_errors_px / one.width_px for one in measured])
    sys.stdout.write(
        f"{name}: {len(measured)} of {len(results)} frames left out found; points {points:.1%} of the eye's "
        f"width off (root mean square, along and across), lids {np.mean(away):.1%} (worst frame "
        f"{max(away):.1%}), lid distance {np.sqrt((gaps**2).mean()):.1%}\n"
    )


def tell_ceiling(name: str, labels: Labels) -> None:
    """Print r of a perfect tracker with labels of several errors."""
    rng = np.random.default_rng(1)
    true = np.concatenate(
        [inter_eyelid_distances(points, labels.markers) for points in labels.frames.values()]
    )
    for error_px in ERRORS_PX:
        correlations = []
        for _ in range(DRAWN):
            drawn = {n: p + rng.normal(0, error_px, p.shape) * [0, 1] for n, p in labels.frames.items()}
            noisy = replace(labels, frames=drawn)
            gaps = [inter_eyelid_distances(points, noisy.markers) for points in drawn.values()]
            correlations.append(np.corrcoef(true, np.concatenate(gaps))[0, 1])
        low, middle, high = np.percentile(correlations, [5, 50, 95])
        sys.stdout.write(
            f"  labels off by {error_px:g} px (sd, across): r {middle:.3f} ({low:.3f} to {high:.3f}), "
            f"openings have sd {true.std():.1f} px\n"
        )


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for name in CLIPS:
        if not (folder / f"{name}.mp4").exists():
            sys.stdout.write(f"{name}: not in {folder}, left out\n")
            continue
        labels = load_labels(folder / f"{name}.points.json")
        tell_ceiling(name, labels)
        tell_left_out(folder, name, labels)


if __name__ == "__main__":
    main()
