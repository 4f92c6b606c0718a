"""What reflections on glasses do to tracking without labels: shut lids seen open, and whether a frame tells.

    PYTHONPATH=. python tests/bench/bench_reflections.py [FOLDER]

FOLDER (../shared/data/face_video) holds recordings NAME.mp4 with NAME.points.json. Two bright panes, or a bar
across the lids, are added to every frame in grey levels and slide by 6% of the eye's width, as a reflection
on glasses does when the head turns. Told of the quarter of labelled frames that are most shut: the opening in
percent of the eye's width by the labels, by the detector and by the track, how many are called doubtful, and
how many percent of the pixels between the lids are saturated, there and in all frames. Needs the detector's
environment, made at first use.
"""

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.labels import Labels, load_labels
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, inter_eyelid_distances, widths
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import Picture, VideoInfo, VideoWriter, frames, rgb, scan_video

FOLDER = Path("../shared/data/face_video")
CLIPS = {"single_face": False, "short_human_3blink": True}
SHAPES = {
    "bar": [(-0.6, -0.22, 0.6, 0.02)],
    "panes": [(-0.3, -0.35, 0.0, 0.3), (0.1, -0.35, 0.4, 0.3)],
}
"""Left, top, right, bottom of each bright part from the eye's middle, in eye's widths."""
CASES = [("none", 0.0), ("bar", 60.0), ("bar", 120.0), ("panes", 60.0), ("panes", 120.0)]
SLIDE = 0.06
SATURATED = 250


def with_reflection(
    picture: Picture, points: Points, shape: str, grey_levels: float, slide: float
) -> Picture:
    """The picture (h, w, 3) with a reflection added over each eye."""
    bright = picture.astype(np.float32)
    for start in range(0, len(points), EYE_POINTS):
        eye = points[start : start + EYE_POINTS]
        width, middle = widths(eye), (eye[0] + eye[5]) / 2
        mask = np.zeros(picture.shape[:2], np.float32)
        for left, top, right, bottom in SHAPES[shape]:
            low = np.int32(middle + np.array([left, top + slide]) * width).tolist()
            high = np.int32(middle + np.array([right, bottom + slide]) * width).tolist()
            cv2.rectangle(mask, low, high, 1.0, -1)
        bright += grey_levels * cv2.GaussianBlur(mask, (0, 0), max(1.0, 0.02 * width))[..., None]
    return np.clip(bright, 0, 255).astype(np.uint8)


def saturated_share(picture: Picture, points: Points) -> float:
    """Percent of the pixels within the hull of each eye's points that are saturated, the worse eye's."""
    grey = picture.max(2)
    shares = []
    for start in range(0, len(points), EYE_POINTS):
        hull = cv2.convexHull(points[start : start + EYE_POINTS].round().astype(np.int32))
        mask = cv2.fillConvexPoly(np.zeros(grey.shape, np.uint8), hull, 1)
        shares.append(100 * float((grey[mask > 0] >= SATURATED).mean()))
    return max(shares)


def tell(name: str, case: str, info: VideoInfo, one_eye: bool, labels: Labels, folder: Path) -> None:
    """Track one reflected clip and print its line."""
    seen = survey(info, one_eye=one_eye)
    lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye)
    track_video(lesson.model, info, folder / "track.csv", None, seen.hints)
    rows = list(track_rows(folder / "track.csv"))
    names = point_columns(labels.eyes)
    found = [numbers(row, names, name).reshape(-1, 2) for row in rows]

    def opening(points: Points) -> float:
        return 100 * float(inter_eyelid_distances(points, labels.markers).mean()) / widths(points)

    true = {n: opening(points) for n, points in labels.frames.items()}
    detected = {n: opening(points) for n, points in seen.points.items()}
    shut = [n for n in sorted(true, key=true.__getitem__)[: len(true) // 4] if n in seen.points]
    shares = [
        saturated_share(picture, points)
        for picture, points in zip(frames(info.path, read=rgb), found, strict=True)
        if np.isfinite(points).all()
    ]
    kept = [n for n, points in enumerate(found) if np.isfinite(points).all()]
    of_shut = [share for n, share in zip(kept, shares, strict=True) if n in shut]
    statuses = [rows[n]["status"] for n in shut]
    by_label, by_detector = (np.mean([of[n] for n in shut]) for of in (true, detected))
    sys.stdout.write(
        f"{name}, {case}: {len(shut)} most shut frames open by labels {by_label:.0f}%, "
        f"detector {by_detector:.0f}%, "
        f"track {np.nanmean([opening(found[n]) for n in shut]):.0f}%; {statuses.count('doubtful')} doubtful, "
        f"{statuses.count('lost')} lost; saturated in them {np.median(of_shut):.1f}% (median), in all frames "
        f"{np.median(shares):.1f}%, most {max(shares):.1f}%\n"
    )


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    for name, one_eye in CLIPS.items():
        if not (folder / f"{name}.mp4").exists():
            sys.stdout.write(f"{name}: not in {folder}, left out\n")
            continue
        info = scan_video(folder / f"{name}.mp4")
        labels = load_labels(folder / f"{name}.points.json", info.size_px, info.frame_count)
        middle = np.median(list(labels.frames.values()), axis=0)
        for shape, grey_levels in CASES:
            with tempfile.TemporaryDirectory() as bare:
                video = Path(bare) / "reflected.mp4"
                with VideoWriter(video, round(info.fps), info.size_px) as writer:
                    for number, picture in enumerate(frames(info.path, read=rgb)):
                        slide = SLIDE * float(np.sin(number / 15))
                        if grey_levels:
                            picture = with_reflection(picture, middle, shape, grey_levels, slide)
                        writer.write(picture)
                tell(name, f"{shape} {grey_levels:g}", scan_video(video), one_eye, labels, Path(bare))


if __name__ == "__main__":
    main()
