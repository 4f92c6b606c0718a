"""The track table, one row per frame, and what came of a frame and of a recording."""

import csv
import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.tracking.shapes import EYE_POINTS, Points
from table_files.open import named_rows

# The track table: one row per frame, written as tracking goes, read back column by column.

COLUMN_MEANINGS = {
    "frame": "frame number from 0",
    "time_s": "presentation time of the frame in seconds, from 0",
    "x01": "first landmark in pixels, x to the right, centers at integers; so on to x18 (one eye: x09)",
    "y01": "first landmark in pixels, y down; likewise to y18 (y09 for one eye)",
    "left_distance_px": "inter-eyelid distance of the image-left eye, perpendicular to the canthus line",
    "right_distance_px": "the same of the image-right eye",
    "distance_px": "the same in one-eye tracks, instead of the two columns before",
    "residual": "root mean square difference of model and picture over the eyes, gray levels of 0 to 255",
    "iterations": "Gauss-Newton iterations used",
    "error_px": "stated error of the frame, root mean square over its points; empty where none is known",
    "e01": "stated error of the first landmark in pixels; so on to e18 (one eye: e09)",
    "status": "tracked, reinitialised (found again), doubtful, or lost (points and distances are empty)",
    "reason": "why a frame is lost or doubtful, or after what it was found again; empty for tracked frames",
}


def point_columns(eyes: int) -> list[str]:
    """x01, y01, x02, ... of all landmarks."""
    return [f"{axis}{number:02d}" for number in range(1, EYE_POINTS * eyes + 1) for axis in "xy"]


def distance_columns(eyes: int) -> list[str]:
    """Names of the inter-eyelid distances."""
    return ["left_distance_px", "right_distance_px"] if eyes == 2 else ["distance_px"]


def error_columns(eyes: int) -> list[str]:
    """e01, e02, ... of all landmarks."""
    return [f"e{number:02d}" for number in range(1, EYE_POINTS * eyes + 1)]


def track_columns(eyes: int) -> list[str]:
    """All columns of a track in order."""
    return [
        "frame",
        "time_s",
        *point_columns(eyes),
        *distance_columns(eyes),
        "residual",
        "iterations",
        "error_px",
        *error_columns(eyes),
        "status",
        "reason",
    ]


class TrackWriter:
    """Writes rows under a temporary name; the file appears when the block ends without an error."""

    def __init__(self, path: Path, eyes: int):
        self._path, self._eyes = path, eyes
        # A lost frame keeps its row, so that row numbers stay frame numbers.
        self._blank = [""] * (len(point_columns(eyes)) + eyes)
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        stream = self._stack.enter_context(whole_text(self._path))
        self._writer = csv.writer(stream, lineterminator="\n")
        self._writer.writerow(track_columns(self._eyes))
        return self

    def write(self, number: int, time_s: float, frame: "TrackedFrame") -> None:
        """Append one frame."""
        if frame.points is None or frame.distances is None:
            cells = self._blank
        else:
            # A thousandth of a pixel is below any tracking error.
            cells = [f"{value:.3f}" for value in (*frame.points.ravel().tolist(), *frame.distances.tolist())]
        residual = "" if frame.residual is None else f"{frame.residual:.3f}"
        self._writer.writerow(
            [
                number,
                f"{time_s:.6f}",
                *cells,
                residual,
                frame.iterations,
                *self._errors(frame),
                frame.status,
                frame.reason,
            ]
        )

    def _errors(self, frame: "TrackedFrame") -> list[str]:
        # Errors are stated for all points or for none.
        if frame.errors is None or not np.isfinite(frame.errors).all():
            return [""] * (1 + EYE_POINTS * self._eyes)
        each = frame.errors.tolist()
        return [f"{value:.3f}" for value in (float(np.sqrt((frame.errors**2).mean())), *each)]

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


def track_rows(path: Path) -> Iterator[dict[str, str]]:
    """Rows of a track (or of the actor's truth) one at a time, as text."""
    if not path.is_file():
        raise InputError(f"{path}: expected a track, found no file; make one with 'stimuli track'")
    header, rows = named_rows(path)
    if "x01" not in header or "frame" not in header:
        raise InputError(f"{path}: not a track; expected the columns frame, time_s, x01, y01 ...")
    yield from (row for _, row in rows)


def numbers(row: dict[str, str], names: list[str], where: str) -> NDArray[np.float64]:
    """Cells of a row as numbers; NaN where a cell is empty because the frame is lost."""
    try:
        # An empty cell is a lost frame, not an error.
        return np.array([float(row[name]) if row[name] else np.nan for name in names])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{where}: row {row.get('frame')} has no number in one of {names[0]} to {names[-1]}"
        ) from error


# What came of a frame, and of a recording.

Status = Literal["tracked", "reinitialised", "doubtful", "lost"]


@dataclass(frozen=True)
class TrackedFrame:
    """One frame's outcome; `points` and `distances` are None exactly when `status` is 'lost'.

    Attributes
    ----------
    points : float64 array (9 * eyes, 2) or None
        In pixels of the video.
    distances : float64 array (eyes,) or None
        In pixels, image-left eye first.
    residual : float or None
        Root mean square gray levels over all base pixels; None if no fit came to an end.
    errors : float64 array (9 * eyes,) or None
        Stated error of each point in pixels.
    """

    status: Status
    reason: str
    points: Points | None
    distances: NDArray[np.float64] | None
    residual: float | None
    iterations: int
    errors: NDArray[np.float64] | None = None


@dataclass
class TrackSummary:
    """Counts and speeds of one run.

    Attributes
    ----------
    repeated : int
        Frames that repeat the one before at even steps, see `Hindsight`.
    fit_s : float
        Processor time of fitting alone.
    reasons : dict
        Status (doubtful or lost) and the words of a reason -> frames, the first of them, its whole reason.
    """

    frames: int = 0
    tracked: int = 0
    reinitialised: int = 0
    doubtful: int = 0
    lost: int = 0
    repeated: int = 0
    fit_s: float = 0.0
    total_s: float = 0.0
    reasons: dict[tuple[str, str], tuple[int, int, str]] = field(default_factory=dict)

    @property
    def fit_fps(self) -> float:
        """Frames fitted per second of fitting."""
        # Before the first frame no time has passed.
        return self.frames / max(self.fit_s, 1e-9)

    @property
    def end_to_end_fps(self) -> float:
        """Frames per second with decoding and writing."""
        return self.frames / max(self.total_s, 1e-9)

    def count(self, frame: TrackedFrame) -> None:
        """Take in the next frame's outcome."""
        if frame.status in ("doubtful", "lost"):
            # Words before the first number or bracket: reasons that differ in figures alone are one kind.
            kind = (frame.status, re.split(r"[:(]|\d", frame.reason)[0].strip())
            # The first frame of each kind is where a person looks.
            number, first, whole = self.reasons.get(kind, (0, self.frames, frame.reason))
            self.reasons[kind] = (number + 1, first, whole)
        self.frames += 1
        # Doubtful and found-again frames have points, too.
        self.tracked += frame.status != "lost"
        self.doubtful += frame.status == "doubtful"
        self.reinitialised += frame.status == "reinitialised"
        self.lost += frame.status == "lost"
