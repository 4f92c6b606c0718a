"""A film of the screen: finds the patch and reads it in every picture."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.video import open_video, scan_video

# What the nine fields of the patch say.
#
# Three by three fields, row by row. The one in the middle is white for odd frames: a photodiode over it
# sees each frame's change. The other eight are the frame's number as a Gray code, lowest bit first: from
# one frame to the next one of them changes, so that a picture which mixes two frames reads as one of them
# or as neither. All white: no frame.

FIELDS = 9
PARITY_FIELD = 4
NUMBERS = 256
"""Numbers come again after this many frames."""
NO_FRAME, UNREADABLE = -1, -2
WHITE_ABOVE, BLACK_BELOW = 0.62, 0.38

CODE_FIELDS = np.array([field for field in range(FIELDS) if field != PARITY_FIELD])


def fields_of_number(number: int) -> NDArray[np.bool_]:
    """White (True) and black fields of a frame, row by row.

    Parameters
    ----------
    number : int
        The frame's number from 0.

    Returns
    -------
    bool array (9,)
    """
    number %= NUMBERS
    # Gray code: only one field of the code changes from frame to frame.
    code = number ^ (number >> 1)
    white = np.empty(FIELDS, np.bool_)
    white[CODE_FIELDS] = [(code >> bit) & 1 == 1 for bit in range(len(CODE_FIELDS))]
    white[PARITY_FIELD] = number % 2 == 1
    return white


def read_numbers(brightness: NDArray[np.float64]) -> NDArray[np.int64]:
    """The number that each picture shows.

    Parameters
    ----------
    brightness : float array (pictures, 9)
        Of each field, 0 black to 1 white.

    Returns
    -------
    int array (pictures,)
        0 to 255, NO_FRAME where all fields are white, UNREADABLE where the patch was changing.
    """
    white = brightness > WHITE_ABOVE
    clear = (white | (brightness < BLACK_BELOW)).all(axis=1)
    numbers = np.array([_NUMBER_OF.get(row.tobytes(), UNREADABLE) for row in white], np.int64)
    return np.where(clear, numbers, UNREADABLE)


_NUMBER_OF = {fields_of_number(number).tobytes(): number for number in range(NUMBERS)}
# All white means none: the frame whose code is all white is even, and its parity field is black.
_NUMBER_OF[np.ones(FIELDS, np.bool_).tobytes()] = NO_FRAME


# Where the patch lies in a film of the screen: the square whose every field turns from white to black.

Grey = NDArray[np.uint8]
Corners = NDArray[np.float32]

RANGE_SHARE = 0.55
"""A field's pixels change by at least this share of the film's greatest change."""
SIDE_PX_MIN = 12
CANDIDATES = 12
QUAD_TOLERANCE = 0.06
FIELD_PX = 16
MIDDLE = slice(5, 11)
"""Only the middle of a straightened field of 16 pixels is read: its rim mixes with the neighbors."""


def range_of(pictures: Iterable[Grey]) -> Grey:
    """How far each pixel's brightness goes, over all pictures; noise is taken off by a small blur."""
    lowest: Grey | None = None
    highest: Grey | None = None
    for picture in pictures:
        smooth = np.asarray(cv2.blur(picture, (3, 3)), np.uint8)
        lowest = smooth if lowest is None else np.minimum(lowest, smooth)
        highest = smooth if highest is None else np.maximum(highest, smooth)
    if lowest is None or highest is None:
        raise InputError("expected a film of the screen, but it has no frames")
    return highest - lowest


def candidates(change: Grey) -> list[Corners]:
    """Four-cornered places that change as a whole, the largest first; corners in clockwise order."""
    level = RANGE_SHARE * float(change.max())
    # Closed, so that thin lines between fields do not divide the patch.
    closed = cv2.morphologyEx((change >= level).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    quads = []
    for outline in sorted(outlines, key=cv2.contourArea, reverse=True)[:CANDIDATES]:
        hull = cv2.convexHull(outline)
        quad = cv2.approxPolyDP(hull, QUAD_TOLERANCE * cv2.arcLength(hull, True), True)
        if len(quad) == 4 and cv2.contourArea(quad) >= SIDE_PX_MIN**2:
            quads.append(_clockwise(quad.reshape(4, 2).astype(np.float32)))
    return quads


def brightness(picture: Grey, corners: Corners) -> NDArray[np.float64]:
    """Mean gray value of each of the nine fields, row by row, 0 to 255."""
    side = 3 * FIELD_PX
    square = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32)
    straight = cv2.warpPerspective(picture, cv2.getPerspectiveTransform(corners, square), (side, side))
    parts = np.asarray(straight, np.float64).reshape(3, FIELD_PX, 3, FIELD_PX)
    means: NDArray[np.float64] = parts[:, MIDDLE, :, MIDDLE].mean(axis=(1, 3))
    return means.reshape(-1)


def _clockwise(corners: Corners) -> Corners:
    around = corners - corners.mean(axis=0)
    # Rows grow downwards, so that rising angles go clockwise.
    return corners[np.argsort(np.arctan2(around[:, 1], around[:, 0]))]


PICTURES_PER_S_MIN = 100.0
CONTRAST_MIN = 25.0
"""Gray values between a field's white and black; less is noise."""
DARKEST, LIGHTEST = 1, 99
"""Percentiles that stand for black and white: single pictures may be spoilt."""

Said = Callable[[str], None]


@dataclass(frozen=True)
class Film:
    """What was read: the time and the number of each picture, and the rate of the camera."""

    times_ms: NDArray[np.float64]
    numbers: NDArray[np.int64]
    pictures_per_s: float
    corners: Corners


def read_film(path: Path, camera_fps: float | None = None, say: Said = lambda _: None) -> Film:
    """Read the patch in every picture of a film.

    Parameters
    ----------
    path : Path
        Any video; the camera must stand still.
    camera_fps : float, optional
        Pictures a second as taken, where the file plays in slow motion; by default the file's own times.
    say : callable
        Called with the current step.

    Raises
    ------
    InputError
        Too few pictures a second, or no patch in it.
    """
    times_ms = _times_ms(path, camera_fps)
    rate = 1000 * (len(times_ms) - 1) / float(times_ms[-1] - times_ms[0])
    if rate < PICTURES_PER_S_MIN:
        raise InputError(
            f"{path}: expected at least {PICTURES_PER_S_MIN:.0f} frames per second, got {rate:.0f}; if the "
            "file plays in slow motion, add the camera's rate: --camera-fps 240"
        )
    say(f"looking for the patch in {len(times_ms)} frames")
    quads = candidates(range_of(_pictures(path)))
    say(f"reading {len(quads)} place(s) that change like a patch")
    corners, numbers = _best(_brightness(path, quads))
    if corners is None or numbers is None:
        raise InputError(
            f"{path}: no sync patch was found. Film the whole patch, in focus and at least 40 pixels wide, "
            "with a still camera, from before the start key until after the clip"
        )
    return Film(times_ms[: len(numbers)], numbers, rate, corners)


def _times_ms(path: Path, camera_fps: float | None) -> NDArray[np.float64]:
    scanned = scan_video(path)
    if scanned.frame_count < 2:
        raise InputError(f"{path}: expected a film, got {scanned.frame_count} picture")
    if camera_fps is None:
        return scanned.times_s * 1000
    return np.arange(scanned.frame_count, dtype=np.float64) * (1000.0 / camera_fps)


def _pictures(path: Path) -> Iterator[Grey]:
    with open_video(path) as (container, stream):
        for frame in container.decode(stream):
            yield frame.to_ndarray(format="gray")


Readings = list[tuple[Corners, NDArray[np.float64]]]


def _brightness(path: Path, quads: list[Corners]) -> Readings:
    """For each place, the fields' brightness in every picture."""
    values: list[list[NDArray[np.float64]]] = [[] for _ in quads]
    if quads:
        for picture in _pictures(path):
            for series, corners in zip(values, quads, strict=True):
                series.append(brightness(picture, corners))
    return [(corners, np.array(series)) for corners, series in zip(quads, values, strict=True)]


def _best(readings: Readings) -> tuple[Corners | None, NDArray[np.int64] | None]:
    """The place, and the way it is turned, in which most frames follow upon the one before."""
    best: tuple[int, Corners | None, NDArray[np.int64] | None] = (0, None, None)
    for corners, values in readings:
        scaled = _scaled(values)
        if scaled is None:
            continue
        square = np.arange(FIELDS).reshape(3, 3)
        for turn in range(4):
            numbers = read_numbers(scaled[:, np.rot90(square, turn).reshape(-1)])
            steps = _steps(numbers)
            if steps > best[0]:
                best = (steps, corners, numbers)
    return best[1], best[2]


def _scaled(values: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Each field from its own black to its own white, 0 to 1: screens and lenses are not even."""
    black, white = np.percentile(values, [DARKEST, LIGHTEST], axis=0)
    if (white - black).min() < CONTRAST_MIN:
        return None
    scaled: NDArray[np.float64] = (values - black) / (white - black)
    return scaled


def _steps(numbers: NDArray[np.int64]) -> int:
    frames = numbers[numbers >= 0]
    return int(((np.diff(frames) % NUMBERS) == 1).sum())
