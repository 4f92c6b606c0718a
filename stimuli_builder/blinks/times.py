"""When the frames of a series were taken: its rate, times that are uneven, and holes in them."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError, counted
from stimuli_builder.blinks.csv_table import few, line_of
from stimuli_builder.blinks.profile import Array

MAX_BRIDGED_MS = 1000 / 30
"""Longest gap that is filled by a straight line: ten frames of the paper's, the filter's width."""
TIMES = "times"
"""Under this name a table keeps which of its columns time_s is from."""
TIME_NAME = re.compile(r"(?:time|timestamp)(?P<unit>s|ms|us|µs|μs|ns|sec|seconds|milliseconds|nanoseconds)?")
"""Letters of their names; a unit s says nothing, because the steps decide it."""
STATED = {
    "ms": "ms",
    "milliseconds": "ms",
    "us": "µs",
    "µs": "µs",
    "μs": "µs",
    "ns": "ns",
    "nanoseconds": "ns",
}
"""Units that a name of times states, by the letters that state them."""
TIMECODE = "timecode"
_TIMECODE = re.compile(r"(\d+):(\d+):(\d+)[:;](\d+(?:\.\d+)?)")
"""Hours, minutes, seconds, frames and parts of one, as Live Link Face writes them."""
TOLD_FPS = (10, 10_000)
"""Rates that may be given."""
RESAMPLED = "resampled"
"""Marks a table whose rows are not lines of its file."""
UNITS = (("s", 1.0, 0.9), ("ms", 1e-3, 200.0), ("µs", 1e-6, 2e5), ("ns", 1e-9, np.inf))
"""Units of times, their seconds, and the step below which a series is in them."""
HOLE_STEPS = 2.5
"""A step of more than this many usual ones, and of more than `MAX_BRIDGED_MS`, is a hole: one frame that was
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
    if _letters(name) == TIMECODE:
        times_s, unit = _timecode_s(table[name], path), "hours:minutes:seconds:frames"
    else:
        times_s, unit = _times_s(table[name], path)
    made = table.assign(time_s=times_s)
    made.attrs = table.attrs | {TIMES: name}
    return made, f"{path.name}: times are from '{name}', in {unit}"


def _times_s(column: pd.Series, path: Path) -> tuple[Array, str]:
    """Seconds of a column of times, and the unit it is in: the one its name states, else by its steps."""
    numbers = pd.to_numeric(column, errors="coerce")
    # Nanoseconds since 1970 have more digits than a float: the first is taken off before.
    times = (numbers - numbers.iloc[0] if numbers.dtype.kind in "iu" else numbers).to_numpy(dtype=np.float64)
    steps = np.diff(times)
    if not steps.size:
        raise InputError(f"{path}: expected two frames or more, got a table of one row")
    if not np.isfinite(steps).all() or (steps == 1).all():
        got = "counts frames" if (steps == 1).all() else "is not a number in every row"
        raise InputError(
            f"{path.name}: '{column.name}' {got}; expected times: add the recording's rate with --fps"
        )
    parts = {unit: part for unit, part, _ in UNITS}
    unit = STATED.get(_stated_unit(str(column.name))) or _unit(float(np.median(steps)))
    return np.asarray(times * parts[unit]), unit


def _timecode_s(column: pd.Series, path: Path) -> Array:
    """Seconds of time codes; frames are counted in the base at which they return to 0.

    The base is measured: a take of 30 frames a second may count them in a base of 60.
    """
    codes = [_TIMECODE.fullmatch(str(cell).strip()) for cell in column]
    if not all(codes) or len(codes) < 2:
        row = next((number for number, one in enumerate(codes) if one is None), 0)
        got = f"got '{column.iloc[row]}' in line {line_of(path, row)}" if len(codes) else "got no row"
        raise InputError(f"{path.name}: '{column.name}' must hold time codes as 01:02:03:04.5, {got}")
    cells = np.array([one.groups() for one in codes if one], dtype=np.float64)
    seconds, frames = cells[:, :3] @ [3600, 60, 1], cells[:, 3]
    steps, turns = np.diff(frames), np.diff(seconds)
    within, across = steps[turns == 0], turns == 1
    usual = float(np.median(within)) if within.size else 1.0
    # Where a second turns, the count of frames falls by the base less a usual step.
    base = float(np.median(usual - steps[across])) if across.any() else float(frames.max() + usual)
    return np.asarray(seconds + frames / max(1.0, round(base)))


def is_time(column: str) -> bool:
    """Whether a column's name is one of times: time, Time (s), time_ms, timestamp [ns], Timecode."""
    letters = _letters(column)
    return letters == TIMECODE or TIME_NAME.fullmatch(letters) is not None


def _stated_unit(column: str) -> str:
    named = TIME_NAME.fullmatch(_letters(column))
    return "" if named is None else named["unit"] or ""


def _letters(column: str) -> str:
    return "".join(letter for letter in column.lower() if letter.isalnum())


def _unit(step: float) -> str:
    """The unit in which a usual step is one of a recording, of 5 frames a second or more.

    Only seconds may be slower, so that a recording of 5 frames per second is recognized.
    """
    return next(unit for unit, _, below in UNITS if step < below)


def refuse_other_rate(table: pd.DataFrame, fps: float, path: Path) -> None:
    """Refuse a rate that contradicts the table's own times, where it has any that are times.

    A column named as times may hold something else: what cannot be read as times says nothing of the rate.
    """
    try:
        timed, _ = with_time_s(table, path)
        measured = _measured_fps(timed, path, uneven=True) if "time_s" in timed.columns else None
    except InputError:
        return
    if measured is not None and TOLD_FPS[0] <= measured <= TOLD_FPS[1]:
        _refuse_contradiction(fps, measured, timed, path)


def _refuse_contradiction(fps: float, measured: float, table: pd.DataFrame, path: Path) -> None:
    if abs(fps / measured - 1) > 0.01:
        raise InputError(
            f"--fps {fps:g} contradicts {path.name}, whose {_name(table)} runs at {measured:.2f}; remove "
            "--fps"
        )


def series_fps(table: pd.DataFrame, fps: float | None, path: Path, *, uneven: bool = False) -> float:
    """Return the frame rate: given, or measured from `time_s`; both must agree within 1%.

    `uneven` takes times whose steps differ, for a series that is resampled.
    """
    measured = _measured_fps(table, path, uneven=uneven) if "time_s" in table.columns else None
    if fps is None and measured is None:
        raise InputError(
            f"{path.name} has no column time_s (it has {few(list(table.columns))}); expected a track, or lid "
            "distances with the recording's rate (--fps)"
        )
    if fps is not None and not (np.isfinite(fps) and TOLD_FPS[0] <= fps <= TOLD_FPS[1]):
        raise InputError(f"the rate must be between 10 and 10000 frames per second, got --fps {fps:g}")
    if fps is not None and measured is not None:
        _refuse_contradiction(fps, measured, table, path)
    rate = measured if measured is not None else fps
    if rate is None or rate < 10:
        # Milliseconds in a column of seconds give a rate that is a thousand times too low.
        hint = ""
        if rate is not None and measured is not None and TOLD_FPS[0] <= 1000 * rate <= TOLD_FPS[1]:
            hint = f". If the times are in ms, name the column time_ms ({1000 * rate:.4g} frames per second)"
        raise InputError(
            f"{path.name}: at {rate:.3g} frames per second blinks cannot be detected; at least 10 are "
            f"needed{hint}"
        )
    return rate


def are_uneven(table: pd.DataFrame) -> bool:
    """Whether the steps of `time_s`, which increase, differ by more than a constant rate's, rounded."""
    times = pd.to_numeric(table["time_s"], errors="coerce").to_numpy(dtype=np.float64)
    steps = np.diff(times)
    rising = steps.size > 0 and bool(np.isfinite(steps).all() and (steps > 0).all())
    return rising and bool((np.abs(steps - np.median(steps)) > _allowed_s(times, steps)).any())


def _out_of_order(times: Array, step: int, table: pd.DataFrame, path: Path) -> str:
    """What is wrong with the first step that does not go forward, and what to do."""
    # Microseconds suffice, also in seconds since 1970, which a short form would show as one number.
    before, after = times[step : step + 2].round(6).tolist()
    name, line = _name(table), line_of(path, step + 1)
    if not np.isfinite([before, after]).all():
        missing = line if np.isfinite(before) else line_of(path, step)
        return f"{path.name}: line {missing} has no {name}; add the time, or remove the row"
    does = "repeats the time of the row before" if times[step] == times[step + 1] else "goes back in time"
    return (
        f"{path.name}: {name} must increase from row to row, but line {line} {does} "
        f"({before:.16g}, then {after:.16g} s). Remove repeated rows, or sort the rows; measure recordings "
        "with different clocks one by one"
    )


def _measured_fps(table: pd.DataFrame, path: Path, *, uneven: bool) -> float:
    times = pd.to_numeric(table["time_s"], errors="coerce").to_numpy(dtype=np.float64)
    steps = np.diff(times)
    if steps.size == 0:
        raise InputError(f"{path.name} has {counted(len(times), 'frame')}; expected two or more")
    # NaN compares as false, so that a missing time is found, too.
    if (wrong := ~(steps > 0)).any():
        raise InputError(_out_of_order(times, int(np.argmax(wrong)), table, path))
    off = np.abs(steps - np.median(steps)) > _allowed_s(times, steps)
    if not uneven and off.any():
        line = line_of(path, int(np.argmax(off)) + 1)  # a step ends at the second of two rows
        raise InputError(
            f"{path.name}: {_name(table)} is uneven (line {line}); blinks need a constant frame rate: add "
            "--resample"
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
        By column, frames of the new table that are in a hole, or next to a row that was not seen.
    note : str
        How many holes, and how long together; empty without one.
    """
    times = table["time_s"].to_numpy(dtype=np.float64)
    steps = np.diff(times)
    count = round((times[-1] - times[0]) * fps) + 1
    if count > MAX_FRAMES:
        raise InputError(
            f"{path.name}: time_s runs over {times[-1] - times[0]:,.0f} s, {count:,} frames at {fps:.4g} fps "
            f"but at most {MAX_FRAMES:,} are allowed. Cut the recording at the pause, or fix time_s"
        )
    # Rounding may put the last frame beyond the last time, where nothing was measured.
    even = np.minimum(times[0] + np.arange(count) / fps, times[-1])
    left = np.clip(np.searchsorted(times, even, side="right") - 1, 0, steps.size - 1)
    away = np.minimum(even - times[left], times[left + 1] - even)
    # Within half a frame of a true time a frame is that time's, at the edge of a hole as well.
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
        f"{_hole_limit_s(steps) * 1000:.0f} ms), {holes.sum():.3g} s in total: excluded from blinks per "
        "minute"
    )


# Runs of frames that are alike, and short gaps filled by straight lines.


def bridge_gaps(values: Array, most_frames: int) -> tuple[Array, int]:
    """Fill inner runs of NaN no longer than `most_frames` by straight lines; return the number filled."""
    filled = values.copy()
    bridged = 0
    for start, stop in runs(np.isnan(values)):
        if start > 0 and stop < values.size and stop - start <= most_frames:
            share = np.arange(1, stop - start + 1) / (stop - start + 1)
            filled[start:stop] = values[start - 1] + share * (values[stop] - values[start - 1])
            bridged += stop - start
    return filled, bridged


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the (start, stop) of every run of True."""
    # With a zero at either end, so that runs which reach it have two edges too.
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
