"""The track table: one row a frame, written as tracking goes, read back column by column."""

import csv
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.tracking.shapes import EYE_POINTS

if TYPE_CHECKING:
    from stimuli_builder.tracking.outcome import TrackedFrame

COLUMN_MEANINGS = {
    "frame": "frame number from 0",
    "time_s": "presentation time of the frame in seconds, from 0",
    "x01": "first landmark in pixels, x to the right, centres at integers; so on to x18 (one eye: x09)",
    "y01": "first landmark in pixels, y down; likewise to y18 (y09 for one eye)",
    "left_distance_px": "inter-eyelid distance of the image-left eye, square to the canthus line",
    "right_distance_px": "the same of the image-right eye",
    "distance_px": "the same in one-eye tracks, instead of the two columns before",
    "residual": "root mean square difference of model and picture over the eyes, grey levels of 0 to 255",
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
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream)
            names = reader.fieldnames or []
            if "x01" not in names or "frame" not in names:
                raise InputError(f"{path}: not a track; expected the columns frame, time_s, x01, y01 ...")
            yield from reader
    except FileNotFoundError as error:
        raise InputError(f"{path}: expected a track, found no file; make one with 'stimuli track'") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a track (it is not text)") from error


def numbers(row: dict[str, str], names: list[str], where: str) -> NDArray[np.float64]:
    """Cells of a row as numbers; NaN where a cell is empty because the frame is lost."""
    try:
        return np.array([float(row[name]) if row[name] else np.nan for name in names])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{where}: row {row.get('frame')} has no number in one of {names[0]} to {names[-1]}"
        ) from error
