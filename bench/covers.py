"""What a track without labels says of eyes that are covered, and of the same recording uncovered.

    python -m bench.covers VIDEO... [--one-eye] [--kinds hand,paper]

Over one eye of each recording, and over both, a cover is pasted that comes in over 0.15 s, stays and goes,
from 45% to 75% of the recording's frames (at most 1.5 s): four fingers in the skin's color, a printed
sheet, a dark thing that shines, the face's own cheek enlarged, a checked cloth, and 'half': fingers that
leave a half of one eye free. It keeps to the eyes as they move, trembles, has soft edges and throws a
shadow. Reported for the recording itself: how many frames have which status. Of each cover: frames at which
it hides 80% of an eye (25% for 'half') and how many of them are called tracked; those at which it hides less,
and how many are; all others, and how many of them have another status than without a cover. Labels are not
refined. Needs the detector's environment.
"""

import argparse
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from bench.harness import say
from stimuli_builder.tracking.labelfree import label_free_lesson
from stimuli_builder.tracking.model import TrainingOptions
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, eye_axis
from stimuli_builder.tracking.survey import survey
from stimuli_builder.tracking.table import track_rows
from stimuli_builder.tracking.track import track_video
from stimuli_builder.video import Picture, VideoWriter, frames, rgb, scan_video

KINDS = ("hand", "paper", "dark", "cheek", "cloth", "half")
SEED = 7


class Cover(NamedTuple):
    """Gray levels (h, w, 3), opacity (h, w) and the shift of its middle from the eyes', in pixels."""

    levels: np.ndarray
    opacity: np.ndarray
    shift: Points


def clouds(size, blur, rng):
    """Noise of one grain, of standard deviation 1."""
    noise = cv2.GaussianBlur(rng.normal(size=(size[0] + 60, size[1] + 60)), (0, 0), blur)[30:-30, 30:-30]
    return noise / noise.std()


def skin(picture, eye):
    """Color of the skin below an eye."""
    _, down, wide = eye_axis(eye)
    x, y = ((eye[0] + eye[5]) / 2 + 0.75 * wide * down).astype(int)
    half = max(2, int(0.15 * wide))
    y = min(y, len(picture) - half - 1)
    return np.median(picture[y - half : y + half, max(0, x - half) : x + half].reshape(-1, 3), axis=0)


def fingers(size, wide, tone, rng):
    """Four fingers side by side, their shading, creases and skin, and where they are."""
    y, x = np.mgrid[: size[0], : size[1]] * 1.0
    across, light, opacity = size[0] / 4, np.zeros(size), np.zeros(size)
    y += rng.uniform(-0.12, 0.12) * (x - size[1] / 2)
    for finger, short in enumerate((0.12, 0.03, 0.0, 0.14)):
        tip, away = (1 - short) * size[1], (y - across * (finger + 0.5)) / (0.53 * across)
        inside = np.hypot(np.maximum(x - tip + across / 2, 0) / (across / 2), away) < 1
        shade = 0.55 + 0.5 * np.sqrt(np.maximum(1 - away**2, 0)) - 0.12 * away
        for crease in (0.35, 0.62, 0.85):
            bent = 0.04 * wide * np.sin(3 * y / across)
            shade -= 0.12 * np.exp(-(((x - tip * crease - bent) / (0.03 * wide)) ** 2))
        light, opacity = np.where(inside, shade, light), np.maximum(opacity, inside)
    grains = ((0.03, 0.01), (0.04, 0.06), (0.05, 0.3))
    rough = 1 + sum(part * clouds(size, max(0.8, grain * wide), rng) for part, grain in grains)
    return tone * (light * rough)[..., None], opacity


def sheet(kind, size, wide, picture, eye, rng):
    """A cover that is not a hand: its gray levels and where it is."""
    y, x = np.mgrid[: size[0], : size[1]] * 1.0
    whole = np.ones(size)
    if kind == "paper":
        lines = (y / (0.22 * wide) % 1 < 0.3) & (clouds(size, max(1, 0.03 * wide), rng) > -0.3)
        ink = 70 * cv2.GaussianBlur(lines * 1.0, (0, 0), max(0.6, 0.01 * wide))
        bright = min(245, 1.5 * skin(picture, eye).mean() + 40)
        return np.repeat((bright * (1 - 0.08 * x / size[1]) - ink)[..., None], 3, axis=2), whole
    if kind == "cloth":
        checks = 25 * ((x // (0.16 * wide) + y // (0.16 * wide)) % 2)
        return (95 + checks + 4 * clouds(size, 1, rng))[..., None] * [1, 0.85, 0.8], whole
    opacity = ((2 * x / size[1] - 1) ** 6 + (2 * y / size[0] - 1) ** 6 < 1) * 1.0
    if kind == "dark":
        gloss = 60 * np.exp(-(((x - 0.3 * size[1] - 0.5 * (y - size[0] / 2)) / (0.08 * size[1])) ** 2))
        return np.repeat((28 + gloss + 12 * clouds(size, 0.5 * wide, rng))[..., None], 3, axis=2), opacity
    left, top = ((eye[0] + eye[5]) / 2 + wide * np.array([-0.7, 0.55])).astype(int)
    top = min(top, len(picture) - int(0.5 * wide))
    cheek = picture[top : top + int(0.9 * wide), max(0, left) : left + int(1.4 * wide)]
    return cv2.resize(cheek, size[::-1], interpolation=cv2.INTER_CUBIC).astype(float), opacity


def cover_of(kind, picture, eyes, rng) -> Cover:
    """A cover for eyes (n, 9, 2) of a picture."""
    wide = float(np.mean([eye_axis(eye)[2] for eye in eyes]))
    size = (int(2 * wide), int(np.ptp(eyes[:, [0, 5], 0]) + 1.4 * wide))
    if kind not in ("hand", "half"):
        return Cover(*sheet(kind, size, wide, picture, eyes[0], rng), np.zeros(2))
    half = [-0.5 * size[1], 0] if len(eyes) == 1 else [0, -0.48 * size[0]]
    shift = np.array(half if kind == "half" else [0, 0], float)
    return Cover(*fingers(size, wide, skin(picture, eyes[0]), rng), shift)


def hidden_share(opacity, eye):
    """How much of an eye is hidden, of the rhomb between its canthi."""
    along, down, wide = eye_axis(eye)
    corners = (eye[0] + eye[5]) / 2 + wide * np.array([-along / 2, -down / 5, along / 2, down / 5])
    mask = cv2.fillConvexPoly(np.zeros(opacity.shape, np.uint8), corners.round().astype(np.int32), 1)
    return float(opacity[mask > 0].mean()) if mask.any() else 0.0


def pasted(picture, cover, middle, wide, rng):
    """The picture with a cover about a point, and the cover's opacity (h, w)."""
    size = picture.shape[1::-1]
    move = np.eye(2, 3)
    move[:, 2] = middle + cover.shift - np.array(cover.opacity.shape[::-1]) / 2
    levels = cv2.warpAffine(cover.levels, move, size, borderMode=cv2.BORDER_REPLICATE)
    opacity = cv2.GaussianBlur(cv2.warpAffine(cover.opacity, move, size), (0, 0), max(0.7, 0.012 * wide))
    shadow = cv2.GaussianBlur(opacity, (0, 0), 0.06 * wide)
    under = picture * (1 - 0.3 * shadow * (1 - opacity))[..., None] * (1 - opacity)[..., None]
    grain = rng.normal(0, 1.5, opacity.shape)[..., None]
    mixed = under + (levels + grain) * opacity[..., None]
    return np.clip(mixed, 0, 255).astype(np.uint8), opacity


def covered(pictures, points, kind, which, fps):
    """Pictures with a cover over the eyes of those numbers, and the share hidden of the most hidden eye."""
    rng = np.random.default_rng(SEED)
    first = int(0.45 * len(pictures))
    last = min(int(0.75 * len(pictures)), first + int(1.5 * fps))
    eyes = points.reshape(len(points), -1, EYE_POINTS, 2)[:, which]
    wide = float(np.mean([eye_axis(eye)[2] for eye in eyes[first]]))
    cover = cover_of(kind, pictures[first], eyes[first], rng)
    spoilt, shares = list(pictures), np.zeros(len(pictures))
    for n in range(first, last):
        near = min(1.0, (n - first + 1) / (0.15 * fps), (last - n) / (0.15 * fps))
        away = np.array([0, 2.6 * wide]) * (1 - near * near * (3 - 2 * near))
        tremor = 0.015 * wide * np.array([np.sin(7 * n / fps), np.cos(5 * n / fps)])
        middle = eyes[n][:, [0, 5]].mean((0, 1)) + away + tremor
        spoilt[n], opacity = pasted(pictures[n], cover, middle, wide, rng)
        shares[n] = max(hidden_share(opacity, eye) for eye in eyes[n])
    return spoilt, shares


def tracked(video: Path, one_eye: bool):
    """Statuses of a track without labels, and the points that were seen, for every frame."""
    info = scan_video(video)
    seen = survey(info, one_eye=one_eye)
    lesson = label_free_lesson(info, seen, TrainingOptions(), one_eye=one_eye, refine=False)
    out = video.with_suffix(".csv")
    track_video(lesson.model, info, out, None, seen.hints)
    known = sorted(seen.points)
    rows = np.array([seen.points[n].ravel() for n in known]).T
    points = np.array([np.interp(np.arange(info.frame_count), known, row) for row in rows]).T
    return np.array([row["status"] for row in track_rows(out)]), points.reshape(info.frame_count, -1, 2)


def written(path: Path, pictures: list[Picture], fps: float) -> Path:
    height, width = (side // 2 * 2 for side in pictures[0].shape[:2])
    with VideoWriter(path, fps, (width, height), crf=16) as video:
        for picture in pictures:
            video.write(np.ascontiguousarray(picture[:height, :width]))
    return path


def counted(statuses, chosen):
    """How many of the chosen frames are tracked, of how many."""
    return f"{np.isin(statuses[chosen], ['tracked', 'reinitialised']).sum()} of {chosen.sum()}"


def tell(video: Path, one_eye: bool, kinds: list[str], folder: Path) -> None:
    """Print the lines of one recording."""
    fps, pictures = scan_video(video).fps, [picture.copy() for picture in frames(video, read=rgb)]
    plain, points = tracked(written(folder / "plain.mp4", pictures, fps), one_eye)
    say(f"{video.name}: {len(plain)} frames, {dict(Counter(plain.tolist()))}")
    for kind in kinds:
        for which in [[0]] if one_eye else [[0], [0, 1]]:
            spoilt, shares = covered(pictures, points, kind, which, fps)
            statuses, _ = tracked(written(folder / "covered.mp4", spoilt, fps), one_eye)
            hidden = shares >= (0.25 if kind == "half" else 0.8)
            clear = shares < 0.01
            say(
                f"  {kind}, {len(which)} eye(s): tracked {counted(statuses, hidden)} covered, "
                f"{counted(statuses, ~hidden & ~clear)} partly; "
                f"{(statuses != plain)[clear].sum()} of {clear.sum()} others have another status"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("videos", nargs="+", type=Path)
    parser.add_argument("--one-eye", action="store_true")
    parser.add_argument("--kinds", default=",".join(KINDS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for video in options.videos:
            tell(video, options.one_eye, options.kinds.split(","), Path(folder))


if __name__ == "__main__":
    main()
