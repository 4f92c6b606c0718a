"""A photodiode over the middle field: each frame's change, without its number.

The field is white without a clip, black for even frames and white for odd ones. A frame that never came makes
one long interval out of three (black, white, black is then black throughout); a late one makes a long and a
short one.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.text_tables import separator_of, whole_text_of

UP, DOWN = 0.6, 0.4
"""Share of the way from dark to light at which the field counts as light, or as dark again."""
PAUSE_FRAMES = 6
"""A field that stays light for longer than this is between clips."""
CONTRAST_MIN = 1e-6
DARKEST, LIGHTEST = 1, 99


@dataclass(frozen=True)
class Trace:
    """Times in ms, ascending, and the diode's values."""

    times_ms: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(frozen=True)
class Changes:
    """Of each play the times at which the field changed, in ms: the onset of frames 0, 1, 2 and so on."""

    plays: tuple[tuple[float, ...], ...]
    period_ms: float

    def intervals_ms(self) -> list[list[float]]:
        """From each change to the next, by play."""
        return [[float(step) for step in np.diff(times)] for times in self.plays]


def read_trace(path: Path) -> Trace:
    """Read a CSV of two columns with a line of names: time in ms, value."""
    if not path.is_file():
        raise InputError(f"{path}: expected a CSV of a photodiode, found none; check the path")
    text = whole_text_of(path)
    lines = list(csv.reader(text.splitlines(), delimiter=separator_of(text.partition("\n")[0])))[1:]
    try:
        rows = np.array([[float(cell) for cell in line[:2]] for line in lines if line], np.float64)
    except ValueError as error:
        raise InputError(f"{path}: expected two columns of numbers, time_ms and value ({error})") from error
    if rows.ndim != 2 or rows.shape[1] != 2 or len(rows) < 2:
        raise InputError(f"{path}: expected two columns of numbers, time_ms and value, and two lines or more")
    if not (np.diff(rows[:, 0]) > 0).all():
        raise InputError(f"{path}: expected times that grow from line to line, in ms")
    return Trace(rows[:, 0], rows[:, 1])


def changes(trace: Trace, fps: float) -> Changes:
    """When the field changed, play by play.

    Parameters
    ----------
    trace : Trace
        At least some samples a frame.
    fps : float
        The clip's frame rate.

    Raises
    ------
    InputError
        The values hardly change, or no clip is in them.
    """
    dark, light = np.percentile(trace.values, [DARKEST, LIGHTEST])
    if light - dark < CONTRAST_MIN:
        raise InputError("expected a diode that sees light and dark, its values hardly change")
    crossings = _crossings(trace.times_ms, (trace.values - dark) / (light - dark))
    period_ms = 1000 / fps
    plays: list[list[float]] = []
    last_ms = -np.inf
    for at_ms, to_light in crossings:
        if not to_light and at_ms - last_ms > PAUSE_FRAMES * period_ms:
            plays.append([])
        if plays:
            plays[-1].append(at_ms)
        last_ms = at_ms
    if not plays:
        raise InputError("expected at least one play after a light field, found none")
    return Changes(tuple(tuple(times) for times in plays), period_ms)


def _crossings(times_ms: NDArray[np.float64], share: NDArray[np.float64]) -> list[tuple[float, bool]]:
    """Each change with its direction, half way between samples; what stays between the levels is noise."""
    changes: list[tuple[float, bool]] = []
    light = bool(share[0] > (UP + DOWN) / 2)
    for sample in range(1, len(share)):
        if (light and share[sample] < DOWN) or (not light and share[sample] > UP):
            light = not light
            changes.append((float(times_ms[sample - 1] + times_ms[sample]) / 2, light))
    return changes
