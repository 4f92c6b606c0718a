"""Recordings against their labels: without labels, by labels, with reflections; characters without labels.

    python -m bench.recordings label-free [FOLDER]
    python -m bench.recordings label-error [FOLDER]
    python -m bench.recordings reflections [FOLDER]
    python -m bench.recordings characters

label-free: FOLDER (../shared/data/face_video) holds NAME.mp4 and NAME.points.json. Distances are means over
lid points from the labeled lid curve, as part of the eye's width; 'worse eye' takes the worse of both in
each frame. Blinks are counted on lid distances of MediaPipe (the detector alone) and of the track: by the
classifier, by prominent peaks as JeFaPaTo finds them, and by the paper's rule. Needs the detector's
environment, made at first use.

label-error: FOLDER (../shared/data/face_video) holds NAME.mp4 and NAME.points.json. Trained without a fifth
of the labels, five times, points and lids (distance of lid points from the labeled lid's curve: a point's
way along the lid is not an error) are compared with those left out. Then the labels are taken for the truth,
and other labels with so many pixels of error across the lid for each point (independent of one another) are
correlated with it in their lid distances, as label-free does with the track's.

reflections: FOLDER (../shared/data/face_video) holds recordings NAME.mp4 with NAME.points.json. Two bright
panes, or a bar across the lids, are added to every frame in gray levels and slide by 6% of the eye's width,
as a reflection on glasses does when the head turns. Reported for the quarter of labeled frames that are most
closed: the opening in percent of the eye's width by the labels, by the detector and by the track, how many
are called doubtful, and how many percent of the pixels between the lids are saturated, there and in all
frames. Needs the detector's environment, made at first use.

characters: `stimuli bake recording` without labels on rendered faces and close-ups. The closure of every
recorded frame is compared with the one it was rendered at, in mm of the opening.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from bench.harness import RECORDINGS, run_part, say
from bench.lid_events import METHODS, counts
from stimuli_builder.characters.atlas import SHIPPED, load_atlas
from stimuli_builder.characters.recording_bake import RecordingOrder, bake_recording
from stimuli_builder.tracking.accuracy import cross_validate
from stimuli_builder.tracking.certainty import lid_difference, lid_offsets
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.labels import Labels, load_labels
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, inter_eyelid_distances, widths
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import numbers, point_columns, track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import Picture, VideoInfo, VideoWriter, frames, read_frames, rgb, scan_video
from tests.stimuli_builder.characters.recordings import Recording

CLIPS = {"single_face": False, "short_human_3blink": True}
BLINKS = {"single_face": [(23, 34)], "short_human_3blink": [(15, 44), (131, 155), (203, 222)]}
"""First and last frame of each blink, as seen."""


def say_lids(what: str, detected: dict[int, Points], labels: dict[int, Points], markers) -> None:
    known = [n for n in labels if n in detected]
    away = np.array([lid_offsets(detected[n], labels[n]).mean() for n in known]) * 100
    worse = np.mean([lid_difference(detected[n], labels[n]) for n in known]) * 100
    one = np.concatenate([inter_eyelid_distances(detected[n], markers) for n in known])
    two = np.concatenate([inter_eyelid_distances(labels[n], markers) for n in known])
    say(
        f"  {what:9} lids {away.mean():.1f}% of the eye's width off (95%: {np.percentile(away, 95):.1f}%, "
        f"most {away.max():.1f}%; worse eye {worse:.1f}%), distance r = {np.corrcoef(one, two)[0, 1]:.3f}, "
        f"{len(known)} of {len(labels)} frames"
    )


def say_blinks(what: str, detected: dict[int, Points], fps: float, name: str, markers) -> None:
    """Blinks of the mean lid distance by each method; a series with unseen frames is bridged by a line."""
    numbers_seen = sorted(detected)
    gaps = [float(np.mean(inter_eyelid_distances(detected[n], markers))) for n in numbers_seen]
    series = np.interp(np.arange(numbers_seen[-1] + 1), numbers_seen, gaps)
    true = [(first / fps, last / fps) for first, last in BLINKS[name]]
    parts = []
    for method, blinks_of in METHODS.items():
        hits, alarms, misses = counts(blinks_of([series], fps), true)
        parts.append(f"{method} {hits:.0f} of {hits + misses:.0f}, {alarms:.0f} false")
    say(f"  {what:9} blinks by " + "; ".join(parts))


def measure_label_free() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else RECORDINGS
    for name, one_eye in CLIPS.items():
        if not (folder / f"{name}.mp4").exists():
            say(f"{name}: not in {folder}, left out")
            continue
        info = scan_video(folder / f"{name}.mp4")
        labels = load_labels(folder / f"{name}.points.json", info.size_px, info.frame_count)
        say(f"{name}: {info.frame_count} frames, {labels.eyes} eye(s), {len(labels.frames)} labeled")
        begun = time.perf_counter()
        seen = survey(info, one_eye=one_eye)
        say(f"  detector  {(time.perf_counter() - begun) / seen.looked_at * 1000:.0f} ms per frame")
        say_lids("detector", seen.points, labels.frames, labels.markers)
        lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye)
        with tempfile.TemporaryDirectory() as bare:
            out = Path(bare) / "track.csv"
            summary = track_video(lesson.model, info, out, None, seen.hints)
            rows = {int(row["frame"]): row for row in track_rows(out)}
        names = point_columns(labels.eyes)
        points = {
            n: numbers(row, names, name).reshape(-1, 2) for n, row in rows.items() if row["status"] != "lost"
        }
        say_lids("track", points, labels.frames, labels.markers)
        say_blinks("detector", seen.points, info.fps, name, labels.markers)
        say_blinks("track", points, info.fps, name, labels.markers)
        stated = [float(rows[n]["error_px"]) for n in labels.frames if n in points]
        true = [
            lid_difference(points[n], labels.frames[n]) * widths(points[n])
            for n in labels.frames
            if n in points
        ]
        say(
            f"  stated error {np.mean(stated):.2f} px, lids off by {np.mean(true):.2f} px (means); "
            f"{np.mean(np.array(true) <= 2 * np.array(stated)):.0%} within twice the stated error"
        )
        say(
            f"  {summary.doubtful} doubtful, {summary.lost} lost; {summary.fit_fps:.0f} frames/s fit only, "
            f"{summary.end_to_end_fps:.0f} with decoding"
        )


ERRORS_PX = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0)
DRAWN = 500


def say_left_out(folder: Path, name: str, labels: Labels) -> None:
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


def say_ceiling(name: str, labels: Labels) -> None:
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


def measure_label_error() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else RECORDINGS
    for name in CLIPS:
        if not (folder / f"{name}.mp4").exists():
            sys.stdout.write(f"{name}: not in {folder}, left out\n")
            continue
        labels = load_labels(folder / f"{name}.points.json")
        say_ceiling(name, labels)
        say_left_out(folder, name, labels)


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


def say_reflected(name: str, case: str, info: VideoInfo, one_eye: bool, labels: Labels, folder: Path) -> None:
    """Track one reflected clip and print its line."""
    seen = survey(info, one_eye=one_eye)
    lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye)
    track_video(lesson.model, info, folder / "track.csv", None, seen.hints)
    rows = list(track_rows(folder / "track.csv"))
    names = point_columns(labels.eyes)
    detected = [numbers(row, names, name).reshape(-1, 2) for row in rows]

    def opening(points: Points) -> float:
        return 100 * float(inter_eyelid_distances(points, labels.markers).mean()) / widths(points)

    true = {n: opening(points) for n, points in labels.frames.items()}
    detected = {n: opening(points) for n, points in seen.points.items()}
    shut = [n for n in sorted(true, key=true.__getitem__)[: len(true) // 4] if n in seen.points]
    shares = [
        saturated_share(picture, points)
        for picture, points in zip(frames(info.path, read=rgb), detected, strict=True)
        if np.isfinite(points).all()
    ]
    kept = [n for n, points in enumerate(detected) if np.isfinite(points).all()]
    of_shut = [share for n, share in zip(kept, shares, strict=True) if n in shut]
    statuses = [rows[n]["status"] for n in shut]
    by_label, by_detector = (np.mean([of[n] for n in shut]) for of in (true, detected))
    sys.stdout.write(
        f"{name}, {case}: {len(shut)} most shut frames open by labels {by_label:.0f}%, "
        f"detector {by_detector:.0f}%, "
        f"track {np.nanmean([opening(detected[n]) for n in shut]):.0f}%; "
        f"{statuses.count('doubtful')} doubtful, "
        f"{statuses.count('lost')} lost; saturated in them {np.median(of_shut):.1f}% (median), in all frames "
        f"{np.median(shares):.1f}%, most {max(shares):.1f}%\n"
    )


def measure_reflections() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else RECORDINGS
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
                say_reflected(
                    name, f"{shape} {grey_levels:g}", scan_video(video), one_eye, labels, Path(bare)
                )


GENERATED = (
    Recording(face="alder-face@4", width_px=720),
    Recording(face="alder-face@4", width_px=480, fps=120, light=0.1, noise=2.5, seed=12, crf=20),
    Recording(face="alder-face@4", width_px=900, fps=120, light=0.12, noise=2, seed=21, crf=20),
    Recording(face="cedar-face@4", width_px=720, light=0.15, noise=2, seed=11, crf=18),
    Recording(face="cedar-face@4", width_px=1080, light=0.05, noise=1.5, seed=18, crf=18),
    Recording(face="cedar-face@4", width_px=600, fps=60, seconds=2.2, onsets=(0.3, 1.2), noise=3, seed=22),
)

CLOSE_UPS = tuple(
    Recording(
        face=face, width_px=1440, fps=120, seconds=1.5, onsets=(0.1, 0.8), noise=2, crf=18, gaze_mm=gaze_mm
    )
    for face, gaze_mm in (("alder@11", -1.0), ("hazel@7", -1.0), ("cedar@7", -1.5))
)
"""The gaze makes up for corners of the eye that are detected too near to the nose."""


def measure_characters() -> None:
    for recording in (*GENERATED, *CLOSE_UPS):
        one_eye = recording in CLOSE_UPS
        with tempfile.TemporaryDirectory() as bare:
            video = Path(bare) / "person.mp4"
            if one_eye:
                recording.write_close_up(video)
            else:
                recording.write(Path(bare))
            baked = bake_recording(RecordingOrder(video, Path(bare) / "made", one_eye=one_eye))
        true_mm = load_atlas(SHIPPED / recording.face).declaration.opening_mm
        recorded = [k for k, level in enumerate(baked.levels) if level.first == level.second]
        off = (baked.measured.closures[recorded] - recording.closure[baked.frames.numbers]) * true_mm
        say(
            f"{recording.face}{', close-up' if one_eye else ''}, {recording.width_px} px, "
            f"{recording.fps:g} fps, seed {recording.seed}: "
            f"closures {off.min():+.2f} to {off.max():+.2f} mm off, RMS {np.sqrt((off**2).mean()):.2f}; "
            f"widest opening {baked.opening_mm - true_mm:+.2f} mm; left-out frames at least "
            f"{np.nanmin(baked.left_out):.1f} dB"
        )


PARTS = {
    "characters": measure_characters,
    "label-free": measure_label_free,
    "label-error": measure_label_error,
    "reflections": measure_reflections,
}

if __name__ == "__main__":
    sys.exit(run_part(PARTS))
