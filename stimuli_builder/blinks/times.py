"""When the frames of a series were taken: its rate, times that are uneven, and holes in them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.counted import counted
from experiments.errors import InputError
from stimuli_builder.blinks.csv_table import few, line_of
from stimuli_builder.blinks.profile import Array

MAX_BRIDGED_MS = 1000 / 30
"""Longest gap that is filled by a straight line: ten frames of the paper's, the filter's width."""
TIMES = "times"
"""Under this name a table keeps which of its columns time_s is from."""
TIME_NAMES = frozenset({"time", "times", "timems", "timestamp", "timestamps", "timestampms"})
"""Letters of their names; of a unit s says nothing, as the steps tell it."""
RESAMPLED = "resampled"
"""So marked, a table's rows are no lines of its file."""
UNITS = (("s", 1.0, 0.9), ("ms", 1e-3, 200.0), ("µs", 1e-6, 2e5), ("ns", 1e-9, np.inf))
"""Units of times, their seconds, and the step below which a series is in them."""
HOLE_STEPS = 2.5
"""A step of more than so many usual ones, and of more than `MAX_BRIDGED_MS`, is a hole: one frame that was
dropped is bridged, and of a blink, which lasts for some 300 ms, no more than at 15 frames a second."""
MAX_FRAMES = 20_000_000
"""23 hours at 240 frames a second, holes included."""
MS_AND_A_HALF = 0.0015
"""Below this step a frame that was dropped is no more than times rounded to ms."""
UNEVEN = 0.2
"""Part of the usual step by which steps may differ in a series that is not resampled."""


def with_time_s(table: pd.DataFrame, path: Path) -> tuple[pd.DataFrame, str]:
    """The table with a column time_s, of another column of times where it has none, and a line on that.

    Raises
    ------
    InputError
        Such a column holds something else than times.
    """
    if "time_s" in table.columns:
        return table, ""
    name = next((one for one in table.columns if is_time(one)), None)
    if name is None:
        return table, ""
    times = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=np.float64)
    steps = np.diff(times)
    if not steps.size or not np.isfinite(steps).all() or (steps == 1).all():
        got = "counts frames" if steps.size and (steps == 1).all() else "is not a number in every row"
        raise InputError(f"{path.name}: '{name}' {got}; expected times: give the recording's rate with --fps")
    unit, part = ("ms", 1e-3) if _letters(name).endswith("ms") else _unit(float(np.median(steps)))
    made = table.assign(time_s=times * part)
    made.attrs = table.attrs | {TIMES: name}
    return made, f"{path.name}: times are from '{name}', in {unit}"


def is_time(column: str) -> bool:
    """Whether a column's name is one of times: time, Time (s), time_ms, timestamp, timestamp_ms."""
    return _letters(column) in TIME_NAMES


def _letters(column: str) -> str:
    return "".join(letter for letter in column.lower() if letter.isalnum())


def _unit(step: float) -> tuple[str, float]:
    """Name and seconds of the unit in which a usual step is one of a recording, of 5 frames a second or more.

    Only seconds may be slower, so that a recording of 5 frames a second is told as what it is.
    """
    return next((unit, part) for unit, part, below in UNITS if step < below)


def series_fps(table: pd.DataFrame, fps: float | None, path: Path, *, uneven: bool = False) -> float:
    """Return the frame rate: given, or measured from `time_s`; both must agree within 1%.

    `uneven` takes times whose steps differ, for a series that is resampled.
    """
    measured = _measured_fps(table, path, uneven=uneven) if "time_s" in table.columns else None
    if fps is None and measured is None:
        raise InputError(
            f"{path.name} has no column time_s (it has {few(list(table.columns))}); expected a "
            "track, or lid distances: give the recording's rate with --fps"
        )
    if fps is not None and not (np.isfinite(fps) and 10 <= fps <= 10_000):
        raise InputError(f"the rate must lie between 10 and 10000 frames a second, got --fps {fps:g}")
    if fps is not None and measured is not None and abs(fps / measured - 1) > 0.01:
        raise InputError(
            f"--fps {fps:g} contradicts {path.name}, whose {_name(table)} runs at {measured:.2f}; "
            "leave --fps out"
        )
    rate = measured if measured is not None else fps
    if rate is None or rate < 10:
        raise InputError(
            f"{path.name}: at {rate:.3g} frames a second no blink can be seen; 10 or more are needed"
        )
    return rate


def _measured_fps(table: pd.DataFrame, path: Path, *, uneven: bool) -> float:
    times = pd.to_numeric(table["time_s"], errors="coerce").to_numpy(dtype=np.float64)
    steps = np.diff(times)
    if steps.size == 0 or not np.isfinite(steps).all() or (steps <= 0).any():
        raise InputError(f"{path.name}: {_name(table)} must be complete and increase from row to row")
    off = np.abs(steps - np.median(steps)) > _allowed_s(times, steps)
    if not uneven and off.any():
        line = line_of(path, int(np.argmax(off)) + 1)  # a step ends at the second of two rows
        raise InputError(
            f"{path.name}: {_name(table)} is uneven (line {line}); labels need a constant frame rate: "
            "--resample brings it to one"
        )
    # A pause of a minute says nothing of the rate.
    return float(1 / steps[~_is_hole(steps)].mean())


def _name(table: pd.DataFrame) -> str:
    return str(table.attrs.get(TIMES, "time_s"))


def _allowed_s(times: Array, steps: Array) -> float:
    """By how much a step may differ from the usual one: times in whole ms are rounded by up to one."""
    usual = float(np.median(steps))
    is_rounded = usual > MS_AND_A_HALF and bool((np.abs(times * 1000 - np.round(times * 1000)) < 1e-3).all())
    return max(UNEVEN * usual, 1.001e-3 if is_rounded else 0.0)


def _is_hole(steps: Array) -> NDArray[np.bool_]:
    return steps > _hole_limit_s(steps)


def _hole_limit_s(steps: Array) -> float:
    return max(HOLE_STEPS * float(np.median(steps)), MAX_BRIDGED_MS / 1000)


def resampled(
    table: pd.DataFrame,
    columns: Sequence[str],
    fps: float,
    path: Path,
    unseen: Mapping[str, NDArray[np.bool_]],
) -> tuple[pd.DataFrame, dict[str, NDArray[np.bool_]], str]:
    """Bring columns to even times at `fps`, by straight lines between true times.

    Gaps stay gaps: a value next to an empty one is empty. So is what lies in a hole of `time_s`.

    Parameters
    ----------
    unseen : mapping of str to (rows,) bool array
        By column, rows that were not seen.

    Returns
    -------
    table : DataFrame
    unseen : dict of str to (n,) bool array
        By column, frames of the new table that lie in a hole, or beside a row that was not seen.
    note : str
        How many holes, and how long together; empty without one.
    """
    times = table["time_s"].to_numpy(dtype=np.float64)
    steps = np.diff(times)
    count = round((times[-1] - times[0]) * fps) + 1
    if count > MAX_FRAMES:
        raise InputError(
            f"{path.name}: time_s runs over {times[-1] - times[0]:,.0f} s, {count:,} frames at {fps:.4g} fps "
            f"where {MAX_FRAMES:,} are the most: cut the recording where it pauses, or mend time_s"
        )
    even = np.minimum(times[0] + np.arange(count) / fps, times[-1])
    left = np.clip(np.searchsorted(times, even, side="right") - 1, 0, steps.size - 1)
    away = np.minimum(even - times[left], times[left + 1] - even)
    in_hole = _is_hole(steps)[left] & (away > 0.5 / fps)
    data: dict[str, Array | pd.Series] = {"frame": np.arange(count, dtype=np.float64), "time_s": even}
    for column in columns:
        values = np.interp(even, times, table[column].to_numpy(dtype=np.float64))
        data[column] = np.where(in_hole, np.nan, values)
    if "status" in table.columns:
        following = np.clip(np.searchsorted(times, even), 0, times.size - 1)
        data["status"] = table["status"].iloc[following].reset_index(drop=True)
    even_table = pd.DataFrame(data)
    even_table.attrs = table.attrs | {RESAMPLED: True}
    unseen_frames = {name: in_hole | rows[left] | rows[left + 1] for name, rows in unseen.items()}
    return even_table, unseen_frames, _hole_note(steps, path)


def _hole_note(steps: Array, path: Path) -> str:
    holes = steps[_is_hole(steps)]
    if not holes.size:
        return ""
    return (
        f"{path.name}: {counted(holes.size, 'hole')} in time_s (steps longer than "
        f"{_hole_limit_s(steps) * 1000:.0f} ms), {holes.sum():.3g} s together, not seen: left out of "
        "blinks a minute"
    )
