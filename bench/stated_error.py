"""How far the stated error of a track is to be trusted: stated against true, frame by frame.

    python -m bench.stated_error [FOLDER]

The truth is exact on the synthetic actor: recordings of four seeds, tracked with 20 labels of 0, 1 or 2 px
noise, with runs of frames spoilt (blurred, darkened, noisy, an eye half covered) so that some may be far off.
FOLDER (../shared/data/face_video) holds recordings NAME.mp4 with NAME.points.json: tracked with every second
labeled frame and compared on the others, and tracked without labels and compared on all. Their labels have
errors too, see the docs.
"""

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import beta

from bench.harness import RECORDINGS
from stimuli_builder.actor.recording import Actor, ActorOptions, label_points, truth_points
from stimuli_builder.tracking.certainty import DOUBTFUL_SHARE, lid_offsets
from stimuli_builder.tracking.detector.mesh import cache_folder
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.labels import Labels, load_labels
from stimuli_builder.tracking.learn import lesson_from
from stimuli_builder.tracking.model import CoupledModel, TrainingOptions
from stimuli_builder.tracking.shapes import LOWER_LID, UPPER_LID, Points, default_markers, widths
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import error_columns, numbers, point_columns, track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import Picture, VideoInfo, VideoWriter, scan_video

CLIPS = {"single_face": False, "short_human_3blink": True}
SECONDS, FPS = 2.5, 120
NOISES_PX = {1: 0.0, 2: 1.0, 3: 1.0, 4: 2.0}
BINS = (0, 0.5, 1, 1.5, 2, 3, 5, 100)
RUN = 12
WRONG_PERCENT = 6
SPOILT = ("blurred", "darkened", "noisy", "covered")


@dataclass(frozen=True)
class Compared:
    """One frame: stated and true error in percent of the eye's width (true: NaN if lost), and its status."""

    stated: float
    true: float
    status: str


def spoilt(picture: Picture, how: str, points: Points, rng: np.random.Generator) -> Picture:
    """The picture made worse in one of four ways."""
    if how == "blurred":
        return np.asarray(cv2.GaussianBlur(picture, (0, 0), rng.uniform(2, 6)), np.uint8)
    if how == "darkened":
        return np.asarray(picture * rng.uniform(0.5, 0.9), np.uint8)
    if how == "noisy":
        noise = rng.normal(0, rng.uniform(10, 40), picture.shape)
        return np.asarray(np.clip(picture + noise, 0, 255), np.uint8)
    left, top = points[:9].min(0).astype(int)
    right, low = points[:9].max(0).astype(int)
    covered = picture.copy()
    covered[top - 5 : top + round(rng.uniform(0.2, 0.7) * (low - top)), left - 5 : right + 5] = 120
    return covered


def spoilt_video(actor: Actor, truth: list[Points], labelled: set[int], path: Path, seed: int) -> None:
    """Write the actor's recording; every third run of 12 frames is spoilt, but no labeled frame."""
    rng = np.random.default_rng(seed)
    with VideoWriter(path, FPS, (512, 384)) as writer:
        for number, points in enumerate(truth):
            picture = actor.frame(number)[0]
            run = number // RUN
            if run % 3 == 2 and number not in labelled:
                picture = spoilt(picture, SPOILT[run // 3 % 4], points, rng)
            writer.write(np.repeat(picture[:, :, None], 3, axis=2))


def actors(folder: Path) -> Iterator[list[Compared]]:
    """Every frame of each recording of the actor."""
    for seed, noise_px in NOISES_PX.items():
        actor = Actor(ActorOptions(seconds=SECONDS, fps=FPS, seed=seed))
        truth = list(truth_points(actor.course))
        labelled = label_points(actor, 20, noise_px)
        video = folder / f"{seed}.mp4"
        spoilt_video(actor, truth, set(labelled), video, seed)
        labels = Labels(folder / "labels.json", (512, 384), default_markers(2), labelled)
        info = scan_video(video)
        model = lesson_from(info, labels, TrainingOptions(), refine=None).model
        yield compared(tracked_rows(info, model, {}), 2, info.path, dict(enumerate(truth)), along=True)


def tracked_rows(info: VideoInfo, model: CoupledModel, hints: dict[int, Points]) -> dict[int, dict]:
    """Rows of the track by frame."""
    with tempfile.TemporaryDirectory() as bare:
        out = Path(bare) / "track.csv"
        track_video(model, info, out, None, hints)
        return {int(row["frame"]): row for row in track_rows(out)}


def compared(
    rows: dict[int, dict], eyes: int, path: str, truth: dict[int, Points], *, along: bool
) -> list[Compared]:
    """Stated and true error of every frame with a truth; not `along`: lid points from the labeled curves."""
    lids = [9 * eye + point for eye in range(eyes) for point in UPPER_LID + LOWER_LID]
    results = []
    for number, true in truth.items():
        row = rows[number]
        if row["status"] == "lost":
            results.append(Compared(np.nan, np.nan, "lost"))
            continue
        points = numbers(row, point_columns(eyes), path).reshape(-1, 2)
        stated = numbers(row, error_columns(eyes), path)
        if along:
            away = np.sqrt(((points - true) ** 2).sum(1).mean()) / widths(true)
        else:
            away, stated = np.sqrt((lid_offsets(points, true) ** 2).mean()), stated[lids]
        share = np.sqrt((stated**2).mean()) / widths(true)
        results.append(Compared(100 * float(share), 100 * float(away), row["status"]))
    return results


def binned(known: list[Compared]) -> Iterator[tuple[float, float, np.ndarray]]:
    """Ends of each bin of the stated error that holds frames, and which of them it holds."""
    stated = np.array([frame.stated for frame in known])
    for low, high in pairwise(BINS):
        inside = (stated >= low) & (stated < high)
        if inside.any():
            yield low, high, inside


def tell(name: str, frames_compared: list[Compared]) -> None:
    """Print the curve: of frames whose stated error lies in a bin, the true one."""
    lost = sum(frame.status == "lost" for frame in frames_compared)
    known = [frame for frame in frames_compared if frame.status != "lost"]
    stated, true = np.array([f.stated for f in known]), np.array([f.true for f in known])
    sys.stdout.write(f"{name}: {len(known)} frames, {lost} lost; % of the eye's width, root mean squares\n")
    for low, high, inside in binned(known):
        s, t = np.sqrt((stated[inside] ** 2).mean()), np.sqrt((true[inside] ** 2).mean())
        within = (true[inside] <= 2 * stated[inside]).mean()
        sys.stdout.write(
            f"  stated {low:4g} to {high:4g}%: {inside.sum():5d} frames  stated {s:5.2f}  true {t:5.2f}  "
            f"within twice the stated {within:4.0%}\n"
        )
    tell_wrong(frames_compared)
    off = [f for f in known if f.true > 100 * DOUBTFUL_SHARE]
    caught = sum(f.status == "doubtful" for f in off)
    good = [f for f in known if f.true <= 100 * DOUBTFUL_SHARE]
    doubted = sum(f.status == "doubtful" for f in good)
    sys.stdout.write(
        f"  all: stated {np.sqrt((stated**2).mean()):.2f}, true {np.sqrt((true**2).mean()):.2f}; "
        f"off by more than 5%: {len(off)}, {caught} of them doubtful, in addition to {lost} lost; "
        f"{doubted} of {len(good)} others doubtful\n"
    )


def tell_wrong(frames_compared: list[Compared]) -> None:
    """Print how many frames called `tracked` are off by more than 6%, and a 95% bound of their share."""
    tracked = [frame for frame in frames_compared if frame.status == "tracked"]
    wrong = sum(frame.true > WRONG_PERCENT for frame in tracked)
    bound = 1.0 if wrong == len(tracked) else float(beta.ppf(0.95, wrong + 1, len(tracked) - wrong))
    sys.stdout.write(
        f"  called tracked: {len(tracked)}, off by more than {WRONG_PERCENT}%: {wrong}; "
        f"at most {bound:.1%} at 95% (Clopper-Pearson, one-sided)\n"
    )


def recordings(folder: Path) -> None:
    """Recorded clips, by every second labeled frame and without labels."""
    for name, one_eye in CLIPS.items():
        if not (folder / f"{name}.mp4").exists():
            sys.stdout.write(f"{name}: not in {folder}, left out\n")
            continue
        info = scan_video(folder / f"{name}.mp4")
        labels = load_labels(folder / f"{name}.points.json", info.size_px, info.frame_count)
        ordered = sorted(labels.frames)
        half = Labels(
            labels.path, labels.size_px, labels.markers, {n: labels.frames[n] for n in ordered[::2]}
        )
        model = lesson_from(info, half, TrainingOptions(), refine=None).model
        others = {n: labels.frames[n] for n in ordered[1::2]}
        tell(
            f"{name}, {len(half.frames)} labels, others compared",
            compared(tracked_rows(info, model, {}), model.eyes, info.path, others, along=True),
        )
        if (cache_folder() / "face-mesh-0.10.21" / "ready").exists():
            seen = survey(info, one_eye=one_eye)
            free = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye).model
            rows = tracked_rows(info, free, seen.hints)
            tell(
                f"{name}, no labels, lids",
                compared(rows, free.eyes, info.path, labels.frames, along=False),
            )


def main() -> None:
    with tempfile.TemporaryDirectory() as bare:
        everything = []
        for (seed, noise_px), frames_compared in zip(NOISES_PX.items(), actors(Path(bare)), strict=True):
            tell(f"actor {seed}, labels with {noise_px:g} px noise", frames_compared)
            everything += frames_compared
        tell("actors together", everything)
    recordings(Path(sys.argv[1]) if len(sys.argv) > 1 else RECORDINGS)


if __name__ == "__main__":
    main()
