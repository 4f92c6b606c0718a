"""From what each picture shows to each frame's onset, and what was missing or late.

Equations: t_k is the onset of frame k, r the clip's frame rate.

(1)  t_k = (a_k + b_k) / 2, where a_k is the last picture that showed frame k - 1 (or an earlier one) and b_k
     the first that showed k; it is known to within u_k = (b_k - a_k) / 2.
(2)  late_k = (t_k - k / r) - median over k of (t_k - k / r).
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError
from experiments.files import whole_text
from stimuli_builder.sync_patch.film import NO_FRAME, NUMBERS, UNREADABLE

RATES = (24.0, 25.0, 30.0, 50.0, 60.0)
BACK_MAX = NUMBERS // 2


@dataclass(frozen=True)
class Onset:
    """A frame's onset and how exactly it is known, in ms."""

    frame: int
    at_ms: float
    within_ms: float


@dataclass(frozen=True)
class PlayOnScreen:
    """One showing of a clip.

    Times are in ms; `late_ms` is by frame, equation (2).

    Attributes
    ----------
    missing : list of int
        Frames never seen, of those up to `frames` - 1.
    """

    onsets: tuple[Onset, ...]
    ended_ms: float
    frames: int
    fps: float

    @property
    def missing(self) -> list[int]:
        """Frames that never were on the screen."""
        seen = {onset.frame for onset in self.onsets}
        return [frame for frame in range(self.frames) if frame not in seen]

    @property
    def intervals_ms(self) -> list[float]:
        """From each onset to the next; the last one to the end."""
        times = [*(onset.at_ms for onset in self.onsets), self.ended_ms]
        return [float(step) for step in np.diff(times)]

    @property
    def late_ms(self) -> list[float]:
        """How much later than the others each frame came, against the clip's own times."""
        delays = np.array([onset.at_ms - 1000 * onset.frame / self.fps for onset in self.onsets])
        # Against the median, so that a single late frame does not move the others.
        return [float(late) for late in delays - np.median(delays)]


def plays(
    times_ms: NDArray[np.float64],
    numbers: NDArray[np.int64],
    fps: float | None = None,
    frames: int | None = None,
) -> list[PlayOnScreen]:
    """Cut the readings into plays.

    Parameters
    ----------
    times_ms : float array (pictures,)
        When each picture was taken.
    numbers : int array (pictures,)
        What it shows, as `read_numbers` gives it.
    fps : float, optional
        The clip's frame rate; by default the usual one nearest to what is seen.
    frames : int, optional
        How many frames the clip has; by default up to the highest number seen in any play.

    Raises
    ------
    InputError
        No play is in it, or only part of one.
    """
    cut = [_onsets(times_ms[part], numbers[part]) for part in _parts(numbers)]
    if not cut:
        raise InputError(
            "expected at least one complete presentation with white before and after it, found none: film "
            "from before the start key until after the clip"
        )
    rate = fps or _rate([onsets for onsets, _ in cut])
    count = frames or 1 + max(onset.frame for onsets, _ in cut for onset in onsets)
    return [PlayOnScreen(tuple(onsets), ended_ms, count, rate) for onsets, ended_ms in cut]


def _parts(numbers: NDArray[np.int64]) -> list[slice]:
    """From the last white picture before each play to the first one after it."""
    white = np.flatnonzero(numbers == NO_FRAME)
    return [
        slice(int(start), int(end) + 1)
        for start, end in pairwise(white)
        # Between two white pictures there may be unreadable ones alone.
        if (numbers[start + 1 : end] >= 0).any()
    ]


def _onsets(times_ms: NDArray[np.float64], numbers: NDArray[np.int64]) -> tuple[list[Onset], float]:
    """Each frame's onset by equation (1), and when the clip was over."""
    onsets: list[Onset] = []
    last_ms = float(times_ms[0])
    # The first and the last picture are white.
    for at_ms, number in zip(times_ms[1:-1], numbers[1:-1], strict=True):
        # It was taken while the patch changed, and lies within the uncertainty of the onset.
        if number == UNREADABLE:
            continue
        frame = _unwrapped(int(number), onsets)
        if not onsets or frame != onsets[-1].frame:
            onsets.append(Onset(frame, (last_ms + float(at_ms)) / 2, (float(at_ms) - last_ms) / 2))
        last_ms = float(at_ms)
    return onsets, (last_ms + float(times_ms[-1])) / 2


def _unwrapped(number: int, before: Sequence[Onset]) -> int:
    """The frame nearest after the previous one; a step back is kept because it shows a fault."""
    if not before:
        return number
    step = (number - before[-1].frame) % NUMBERS
    return before[-1].frame + (step if step < BACK_MAX else step - NUMBERS)


def _rate(cut: Sequence[Sequence[Onset]]) -> float:
    steps = [
        (after.at_ms - before.at_ms) / (after.frame - before.frame)
        for onsets in cut
        for before, after in pairwise(onsets)
        if after.frame > before.frame
    ]
    if not steps:
        raise InputError("expected a clip of at least two frames, found one: add its rate with --fps")
    seen = 1000 / float(np.median(steps))
    # By ratio: 30 and 60 are as far apart as 60 and 120.
    return min(RATES, key=lambda rate: abs(np.log(rate / seen)))


# A photodiode over the middle field: each frame's change, without its number.
#
# The field is white without a clip, black for even frames and white for odd ones. A frame that never came
# makes one long interval out of three (black, white, black is then black throughout); a late one makes a
# long and a short one.

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
    """For each play, the times in ms at which the field changed: the onset of frames 0, 1, 2 and so on."""

    plays: tuple[tuple[float, ...], ...]
    period_ms: float

    def intervals_ms(self) -> list[list[float]]:
        """From each change to the next, by play."""
        return [[float(step) for step in np.diff(times)] for times in self.plays]


def read_trace(path: Path) -> Trace:
    """Read a CSV of two columns with a line of names: time in ms, value."""
    if not path.is_file():
        raise InputError(f"{path}: expected a CSV of a photodiode, found none; check the path")
    from stimuli_builder.blinks.csv_table import read_table  # pandas, for this alone

    table = read_table(path)
    try:
        rows = table.iloc[:, :2].to_numpy(dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{path}: expected two columns of numbers, time_ms and value ({error})") from error
    if rows.ndim != 2 or rows.shape[1] != 2 or len(rows) < 2:
        raise InputError(f"{path}: expected two columns of numbers, time_ms and value, and two lines or more")
    if not (np.diff(rows[:, 0]) > 0).all():
        raise InputError(f"{path}: expected times in ms that increase from line to line")
    return Trace(rows[:, 0], rows[:, 1])


def changes(trace: Trace, fps: float) -> Changes:
    """When the field changed, play by play.

    Parameters
    ----------
    trace : Trace
        At least some samples per frame.
    fps : float
        The clip's frame rate.

    Raises
    ------
    InputError
        The values hardly change, or no clip is in them.
    """
    dark, light = np.percentile(trace.values, [DARKEST, LIGHTEST])
    if light - dark < CONTRAST_MIN:
        raise InputError("expected a diode trace with light and dark, but its values hardly change")
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
        raise InputError("expected at least one presentation after a light field, found none")
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


# What `stimuli scope` prints, and the CSV of onsets.

COLUMNS = ("play", "frame", "onset_ms", "within_ms", "interval_ms", "late_ms")
LONG_SHARE = 1.5
"""An interval of more than this many frames' time is named as long."""
NAMED_MAX = 12


def of_film(plays: Sequence[PlayOnScreen], pictures_per_s: float) -> list[str]:
    """One line per play, and one over all."""
    lines = [
        f"{len(plays)} presentation(s) of {plays[0].frames} frames at {plays[0].fps:g} fps; onsets accurate "
        f"to {500 / pictures_per_s:.1f} ms ({pictures_per_s:.0f} frames per second)"
    ]
    lines += [f"presentation {number}: {_play(play)}" for number, play in enumerate(plays, start=1)]
    complete = sum(not play.missing for play in plays)
    worst = max(max(abs(late) for late in play.late_ms) for play in plays)
    return [
        *lines,
        (
            f"{complete} of {len(plays)} presentation(s) without a missing frame; maximum deviation "
            f"{worst:.1f} ms"
        ),
    ]


def _play(play: PlayOnScreen) -> str:
    missing = play.missing
    named = ", ".join(str(frame) for frame in missing[:NAMED_MAX])
    more = "" if len(missing) <= NAMED_MAX else f" and {len(missing) - NAMED_MAX} more"
    gone = f"{len(missing)} missing ({named}{more})" if missing else "none missing"
    intervals, late = play.intervals_ms, play.late_ms
    return (
        f"{gone}; intervals {min(intervals):.1f} to {max(intervals):.1f} ms; {min(late):+.1f} to "
        f"{max(late):+.1f} ms from the clip's times"
    )


def of_trace(changes: Changes) -> list[str]:
    """One line per play: a photodiode sees changes and no numbers."""
    lines = []
    for number, steps in enumerate(changes.intervals_ms(), start=1):
        long = [step for step in steps if step > LONG_SHARE * changes.period_ms]
        ends = f"intervals {min(steps):.1f} to {max(steps):.1f} ms" if steps else "no interval"
        lines.append(
            f"presentation {number}: {len(steps) + 1} changes; {ends}; {len(long)} longer than a frame and a "
            "half"
        )
    return [
        *lines,
        ("A photodiode cannot distinguish a missing frame from a late one; a film of the patch can."),
    ]


def rows_of_film(plays: Sequence[PlayOnScreen]) -> list[tuple[object, ...]]:
    """One row per frame, as in COLUMNS."""
    return [
        (number, onset.frame, *(round(value, 3) for value in (onset.at_ms, onset.within_ms, interval, late)))
        for number, play in enumerate(plays, start=1)
        for onset, interval, late in zip(play.onsets, play.intervals_ms, play.late_ms, strict=True)
    ]


def rows_of_trace(changes: Changes) -> list[tuple[object, ...]]:
    """One row per change; which frame it was is not known."""
    return [
        (number, "", round(at_ms, 3), "", round(step, 3) if step is not None else "", "")
        for number, times in enumerate(changes.plays, start=1)
        for at_ms, step in zip(times, [*(b - a for a, b in pairwise(times)), None], strict=True)
    ]


def write_csv(path: Path, rows: Sequence[tuple[object, ...]]) -> None:
    """Write the table whole or not at all."""
    with whole_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)
