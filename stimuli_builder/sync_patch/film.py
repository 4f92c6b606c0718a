"""A film of the screen: finds the patch and reads it in every picture."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.sync_patch import code, locate
from stimuli_builder.video import opened
from stimuli_builder.video_scan import scan_video

PICTURES_PER_S_MIN = 100.0
CONTRAST_MIN = 25.0
"""Grey values between a field's white and black; less is noise."""
DARKEST, LIGHTEST = 1, 99
"""Percentiles that stand for black and white: single pictures may be spoilt."""

Said = Callable[[str], None]


@dataclass(frozen=True)
class Film:
    """What was read: the time and the number of each picture, and the rate of the camera."""

    times_ms: NDArray[np.float64]
    numbers: NDArray[np.int64]
    pictures_per_s: float
    corners: locate.Corners


def read_film(path: Path, camera_fps: float | None = None, say: Said = lambda _: None) -> Film:
    """Read the patch in every picture of a film.

    Parameters
    ----------
    path : Path
        Any video; the camera must stand still.
    camera_fps : float, optional
        Pictures a second as taken, where the file plays in slow motion; by default the file's own times.
    say : callable
        Is told what is being done.

    Raises
    ------
    InputError
        Too few pictures a second, or no patch in it.
    """
    times_ms = _times_ms(path, camera_fps)
    rate = 1000 * (len(times_ms) - 1) / float(times_ms[-1] - times_ms[0])
    if rate < PICTURES_PER_S_MIN:
        raise InputError(
            f"{path}: expected at least {PICTURES_PER_S_MIN:.0f} pictures a second, got {rate:.0f}; "
            "where the file plays in slow motion, say how it was taken: --camera-fps 240"
        )
    say(f"looking for the patch in {len(times_ms)} pictures")
    quads = locate.candidates(locate.range_of(_pictures(path)))
    say(f"reading {len(quads)} place(s) that change as a patch does")
    corners, numbers = _best(_brightness(path, quads))
    if corners is None or numbers is None:
        raise InputError(
            f"{path}: found no sync patch; film the whole patch, sharp and at least 40 pixels wide, "
            "with the camera still, from before the start key until after the clip"
        )
    return Film(times_ms[: len(numbers)], numbers, rate, corners)


def _times_ms(path: Path, camera_fps: float | None) -> NDArray[np.float64]:
    scanned = scan_video(path)
    if scanned.frame_count < 2:
        raise InputError(f"{path}: expected a film, got {scanned.frame_count} picture")
    if camera_fps is None:
        return scanned.times_s * 1000
    return np.arange(scanned.frame_count, dtype=np.float64) * (1000.0 / camera_fps)


def _pictures(path: Path) -> Iterator[locate.Grey]:
    with opened(path) as (container, stream):
        for frame in container.decode(stream):
            yield frame.to_ndarray(format="gray")


Readings = list[tuple[locate.Corners, NDArray[np.float64]]]


def _brightness(path: Path, quads: list[locate.Corners]) -> Readings:
    """Of each place the fields' brightness in every picture."""
    values: list[list[NDArray[np.float64]]] = [[] for _ in quads]
    if quads:
        for picture in _pictures(path):
            for series, corners in zip(values, quads, strict=True):
                series.append(locate.brightness(picture, corners))
    return [(corners, np.array(series)) for corners, series in zip(quads, values, strict=True)]


def _best(readings: Readings) -> tuple[locate.Corners | None, NDArray[np.int64] | None]:
    """The place, and the way it is turned, in which most frames follow upon the one before."""
    best: tuple[int, locate.Corners | None, NDArray[np.int64] | None] = (0, None, None)
    for corners, values in readings:
        scaled = _scaled(values)
        if scaled is None:
            continue
        square = np.arange(code.FIELDS).reshape(3, 3)
        for turn in range(4):
            numbers = code.read(scaled[:, np.rot90(square, turn).reshape(-1)])
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
    return int(((np.diff(frames) % code.NUMBERS) == 1).sum())
