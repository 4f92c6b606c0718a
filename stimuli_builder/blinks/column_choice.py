"""Which columns of a table are the series to label."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.csv_table import few
from stimuli_builder.blinks.times import is_time
from stimuli_builder.blinks.validity import CONFIDENCE_COLUMN, is_validity

DISTANCE_COLUMNS = ("left_distance_px", "right_distance_px", "distance_px")
INDEX_COLUMNS = ("frame", CONFIDENCE_COLUMN)


def choose_columns(table: pd.DataFrame, named: Sequence[str], path: Path) -> list[str]:
    """Return the distance columns to label: those named, else a track's, else the only candidate."""
    candidates = [
        str(name)
        for name in table.columns
        if table[name].dtype.kind == "f" and not _is_of_another_kind(str(name))
    ]
    for name in named:
        if name not in table.columns:
            raise InputError(f"{path.name} has no column '{name}'{_near_or_plausible(name, candidates)}")
    if named:
        return list(dict.fromkeys(named))
    tracked = [name for name in DISTANCE_COLUMNS if name in table.columns]
    if tracked:
        return tracked
    if len(candidates) == 1:
        return candidates
    there = few(candidates) or "no column of decimal numbers but the times"
    raise InputError(f"{path.name}: say with --column which series to label; it has {there}")


def _is_of_another_kind(name: str) -> bool:
    """Whether a column's name is one of frame numbers, times or validity."""
    return name.lower() in INDEX_COLUMNS or is_validity(name) or is_time(name)


def _near_or_plausible(name: str, candidates: Sequence[str]) -> str:
    near = nearest(name, candidates)
    if near is not None:
        return f"; did you mean '{near}'?"
    plausible = few([one for one in candidates if one in DISTANCE_COLUMNS] or candidates)
    return f"; expected one of: {plausible}" if plausible else ""
