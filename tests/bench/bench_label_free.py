"""Tracking without labels on real clips beside MediaPipe alone and JeFaPaTo's method on the same frames.

    python tests/bench/bench_label_free.py [FOLDER]

FOLDER (../shared/data/face_video) holds NAME.mp4 and NAME.points.json. Distances are means over lid points
from the labelled lid curve, as part of the eye's width; 'worse eye' takes the worse of both in each frame.
Blinks are counted on lid distances of MediaPipe (the detector alone) and of the track: by the classifier, by
prominent peaks as JeFaPaTo finds them, and by the paper's rule. Needs the detector's environment,
made at first use.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bench_lid_events import METHODS, counts

from stimuli_builder.tracking.certainty import lid_difference, lid_offsets
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import Points, inter_eyelid_distances, widths
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import scan_video

FOLDER = Path("../shared/data/face_video")
CLIPS = {"single_face": False, "short_human_3blink": True}
BLINKS = {"single_face": [(23, 34)], "short_human_3blink": [(15, 44), (131, 155), (203, 222)]}
"""First and last frame of each blink, as seen."""


def print_line(text: str) -> None:
    sys.stdout.write(text + "\n")


def tell(what: str, found: dict[int, Points], labels: dict[int, Points], markers) -> None:
    known = [n for n in labels if n in found]
    away = np.array([lid_offsets(found[n], labels[n]).mean() for n in known]) * 100
    worse = np.mean([lid_difference(found[n], labels[n]) for n in known]) * 100
    one = np.concatenate([inter_eyelid_distances(found[n], markers) for n in known])
    two = np.concatenate([inter_eyelid_distances(labels[n], markers) for n in known])
    print_line(
        f"  {what:9} lids {away.mean():.1f}% of the eye's width off (95%: {np.percentile(away, 95):.1f}%, "
        f"most {away.max():.1f}%; worse eye {worse:.1f}%), distance r = {np.corrcoef(one, two)[0, 1]:.3f}, "
        f"{len(known)} of {len(labels)} frames"
    )


def tell_blinks(what: str, found: dict[int, Points], fps: float, name: str, markers) -> None:
    """Blinks of the mean lid distance by each method; a series with unseen frames is bridged by a line."""
    numbers_seen = sorted(found)
    gaps = [float(np.mean(inter_eyelid_distances(found[n], markers))) for n in numbers_seen]
    series = np.interp(np.arange(numbers_seen[-1] + 1), numbers_seen, gaps)
    true = [(first / fps, last / fps) for first, last in BLINKS[name]]
    parts = []
    for method, blinks_of in METHODS.items():
        hits, alarms, misses = counts(blinks_of([series], fps), true)
        parts.append(f"{method} {hits:.0f} of {hits + misses:.0f}, {alarms:.0f} false")
    print_line(f"  {what:9} blinks by " + "; ".join(parts))


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for name, one_eye in CLIPS.items():
        if not (folder / f"{name}.mp4").exists():
            print_line(f"{name}: not in {folder}, left out")
            continue
        info = scan_video(folder / f"{name}.mp4")
        labels = load_labels(folder / f"{name}.points.json", info.size_px, info.frame_count)
        print_line(f"{name}: {info.frame_count} frames, {labels.eyes} eye(s), {len(labels.frames)} labelled")
        begun = time.perf_counter()
        seen = survey(info, one_eye=one_eye)
        print_line(f"  detector  {(time.perf_counter() - begun) / seen.looked_at * 1000:.0f} ms a frame")
        tell("detector", seen.points, labels.frames, labels.markers)
        lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye)
        with tempfile.TemporaryDirectory() as bare:
            out = Path(bare) / "track.csv"
            summary = track_video(lesson.model, info, out, None, seen.hints)
            rows = {int(row["frame"]): row for row in track_rows(out)}
        names = point_columns(labels.eyes)
        points = {
            n: numbers(row, names, name).reshape(-1, 2) for n, row in rows.items() if row["status"] != "lost"
        }
        tell("track", points, labels.frames, labels.markers)
        tell_blinks("detector", seen.points, info.fps, name, labels.markers)
        tell_blinks("track", points, info.fps, name, labels.markers)
        stated = [float(rows[n]["error_px"]) for n in labels.frames if n in points]
        true = [
            lid_difference(points[n], labels.frames[n]) * widths(points[n])
            for n in labels.frames
            if n in points
        ]
        print_line(
            f"  stated error {np.mean(stated):.2f} px, lids off by {np.mean(true):.2f} px (means); "
            f"{np.mean(np.array(true) <= 2 * np.array(stated)):.0%} within twice the stated error"
        )
        print_line(
            f"  {summary.doubtful} doubtful, {summary.lost} lost; {summary.fit_fps:.0f} frames/s fit only, "
            f"{summary.end_to_end_fps:.0f} with decoding"
        )


if __name__ == "__main__":
    main()
