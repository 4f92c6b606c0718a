"""The lid network beside MediaPipe: distance of lid points from the labelled curves of recordings.

    python -m tools.lid_network.compare NETWORK.onnx [FOLDER]

FOLDER (../shared/data/face_video) holds NAME.mp4 and NAME.points.json. The network begins in the region that
MediaPipe's canthi give and looks again where it saw the eye itself; OpenCV runs it.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.certainty import lid_offsets
from stimuli_builder.tracking.detector.detection import eye_points
from stimuli_builder.tracking.labels import load_labels
from stimuli_builder.tracking.survey import survey
from stimuli_builder.video import frames, rgb, scan_video
from tools.lid_network.augment import EYE_PX, SIZE, normalised

Values = NDArray[np.float64]
FOLDER = Path("../shared/data/face_video")
CLIPS = {"single_face": False, "short_human_3blink": True}
LOOKS = 3
JITTERS = ((0.0, 0.0, 1.0), (0.06, 0.03, 0.93), (-0.06, -0.03, 1.07), (0.06, -0.03, 1.0), (-0.06, 0.03, 1.0))
MIDDLE = (np.array(SIZE) - 1) / 2


@dataclass(frozen=True)
class Region:
    """Where an eye is thought to be: the middle of its canthi, their distance, and their line's angle."""

    x: float
    y: float
    width: float
    angle: float

    @classmethod
    def of(cls, canthi: Values) -> "Region":
        """The region of two canthi (2, 2)."""
        across = canthi[1] - canthi[0]
        x, y = canthi.mean(0)
        return cls(float(x), float(y), float(np.hypot(*across)), float(np.arctan2(across[1], across[0])))

    def matrix(self) -> Values:
        """(2, 3) from the recording to the network's picture."""
        scale = EYE_PX / self.width
        a = scale * np.array(
            [[np.cos(self.angle), np.sin(self.angle)], [-np.sin(self.angle), np.cos(self.angle)]]
        )
        return np.column_stack([a, MIDDLE - a @ np.array([self.x, self.y])])


@dataclass(frozen=True)
class SeenEye:
    """Lids (11, 2) from image-left to image-right, iris (x, y, radius), stated error of the points; in px."""

    upper: Values
    lower: Values
    iris: Values
    error: Values


class LidNetwork:
    """The exported network."""

    def __init__(self, file: Path) -> None:
        self._net = cv2.dnn.readNetFromONNX(str(file))

    def __call__(self, grey: NDArray[np.uint8], region: Region) -> SeenEye:
        """The eye, the mean of what is seen in the region and in four moved ones."""
        for _ in range(LOOKS):
            lids, iris, error = self._looked(grey, region)
            region = Region.of(lids[[0, 1]])
        upper = np.concatenate([lids[:1], lids[2:11], lids[1:2]])
        lower = np.concatenate([lids[:1], lids[11:], lids[1:2]])
        return SeenEye(upper, lower, iris, error)

    def _looked(self, grey: NDArray[np.uint8], region: Region) -> tuple[Values, Values, Values]:
        moved = [
            Region(
                region.x + dx * region.width, region.y + dy * region.width, region.width * grow, region.angle
            )
            for dx, dy, grow in JITTERS
        ]
        matrices = [one.matrix() for one in moved]
        pictures = np.array([_cut(grey, matrix) for matrix in matrices])
        self._net.setInput(pictures[:, None])
        rows = np.asarray(self._net.forward(), np.float64)
        lids, irises = [], []
        for row, matrix in zip(rows, matrices, strict=True):
            back = cv2.invertAffineTransform(matrix)
            at = row[:42].reshape(21, 2) * EYE_PX + MIDDLE
            at = at @ back[:, :2].T + back[:, 2]
            lids.append(at[:20])
            irises.append([*at[20], np.exp(row[42]) * region.width])
        return np.mean(lids, axis=0), np.mean(irises, axis=0), np.exp(rows[:, 43:63].mean(0)) * region.width


def _cut(grey: NDArray[np.uint8], matrix: Values) -> NDArray[np.float32]:
    scale = float(np.hypot(*matrix[0, :2]))
    if scale < 0.7:
        grey = cv2.GaussianBlur(grey, (0, 0), 0.5 / scale)
    return normalised(
        cv2.warpAffine(grey, matrix, SIZE, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def tracker_points(eye: SeenEye, outer_left: bool) -> Values:
    """Nine points from the outer canthus."""
    if outer_left:
        return eye_points(eye.upper, eye.lower[::-1])
    return eye_points(eye.upper[::-1], eye.lower)


def seen_points(network: LidNetwork, grey: NDArray[np.uint8], start: Values) -> Values:
    """Points (9 * eyes, 2) of the network that begins at a detector's points."""
    parts = []
    for eye, first in enumerate(range(0, len(start), 9)):
        canthi = start[[first, first + 5]]
        canthi = canthi[np.argsort(canthi[:, 0])]
        parts.append(tracker_points(network(grey, Region.of(canthi)), outer_left=eye == 0))
    return np.concatenate(parts)


def main() -> None:
    """Print both detectors' distances."""
    network = LidNetwork(Path(sys.argv[1]))
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else FOLDER
    for name, one_eye in CLIPS.items():
        info = scan_video(folder / f"{name}.mp4")
        labels = load_labels(folder / f"{name}.points.json", info.size_px, info.frame_count)
        seen = survey(info, one_eye=one_eye)
        away: dict[str, list[float]] = {"MediaPipe": [], "the network": []}
        for number, picture in enumerate(frames(info.path, read=rgb)):
            if number in labels.frames and number in seen.points:
                true, start = labels.frames[number], seen.points[number]
                own = seen_points(network, cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), start)
                away["MediaPipe"].append(float(lid_offsets(start, true).mean()))
                away["the network"].append(float(lid_offsets(own, true).mean()))
        for detector, parts in away.items():
            told = f"{np.mean(parts):.1%} of the eye's width off, worst {max(parts):.1%}"
            print(f"{name}: {detector} {told}, {len(parts)} frames")


if __name__ == "__main__":
    main()
