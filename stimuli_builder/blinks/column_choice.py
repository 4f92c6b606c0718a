"""Which columns of a table are the series to label."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.column_names import eye_pair, is_of_lids
from stimuli_builder.blinks.csv_table import few
from stimuli_builder.blinks.times import is_time
from stimuli_builder.blinks.validity import CONFIDENCE_COLUMN, is_validity

DISTANCE_COLUMNS = ("left_distance_px", "right_distance_px", "distance_px")
INDEX_COLUMNS = ("frame", CONFIDENCE_COLUMN)


def choose_columns(table: pd.DataFrame, named: Sequence[str], path: Path) -> tuple[list[str], list[str]]:
    """The distance columns to label: those named, else a track's, else the only candidate or pair of eyes.

    Of several, one that holds 0 and 1 alone, or the same as one before it, is no second eye and left out.

    Returns
    -------
    columns, notes : list of str
        And a line about each that is left out, and about eyes that were taken without being named.
    """
    candidates = [
        str(name)
        for name in table.columns
        if table[name].dtype.kind == "f" and not _is_of_another_kind(str(name))
    ]
    for name in named:
        if name not in table.columns:
            raise InputError(f"{path.name} has no column '{name}'{_near_or_plausible(name, candidates)}")
    if named:
        return _distinct(table, list(dict.fromkeys(named)), path)
    tracked = [name for name in DISTANCE_COLUMNS if name in table.columns]
    if tracked:
        return tracked, []
    measures = [name for name in candidates if not _is_presence(table[name])]
    if len(measures) == 1 or len(candidates) == 1:
        return measures or candidates, []
    lids = [name for name in measures if is_of_lids(name)]
    if len(lids) == 2 and eye_pair(lids) is not None:
        measures = lids
    if len(measures) == 2 and eye_pair(measures) is not None:
        eyes = " and ".join(f"'{name}'" for name in measures)
        return measures, [f"{path.name}: {eyes} are taken as the two eyes; --column NAME takes another"]
    raise InputError(f"{path.name}: {_not_chosen(table, candidates)}")


def _distinct(table: pd.DataFrame, named: list[str], path: Path) -> tuple[list[str], list[str]]:
    """The columns that may be eyes beside one another, and a line about each of the others."""
    kept: list[str] = []
    notes = []
    measures = [name for name in named if not _is_presence(table[name])]
    for name in named:
        twin = next((one for one in kept if table[one].equals(table[name])), None)
        if measures and name not in measures:
            notes.append(f"{path.name}: '{name}' holds only 0 and 1, a presence and no eye: left out")
        elif twin is not None:
            notes.append(f"{path.name}: '{name}' holds the same values as '{twin}', no second eye: left out")
        else:
            kept.append(name)
    return kept, notes


def _is_presence(column: pd.Series) -> bool:
    """Whether a column says by 0 and 1 alone that something is there, as OpenFace's AU45_c."""
    return column.dtype.kind in "fiub" and set(column.dropna().unique().tolist()) == {0, 1}


def _not_chosen(table: pd.DataFrame, candidates: Sequence[str]) -> str:
    """Why no column is chosen, and what to do."""
    if candidates:
        return f"say with --column which series to label; it has {few(candidates)}"
    whole = [
        f"'{name}' (whole numbers)"
        for name in table.columns
        if table[name].dtype.kind in "iu" and not _is_of_another_kind(str(name))
    ]
    if not whole:
        return "say with --column which series to label; it has no column of numbers but the times"
    return (
        f"expected a column of decimal numbers, got {few(whole)}; if one of them is the distance, name it "
        "with --column"
    )


def _is_of_another_kind(name: str) -> bool:
    """Whether a column's name is one of frame numbers, times or validity."""
    return name.lower() in INDEX_COLUMNS or is_validity(name) or is_time(name)


def _near_or_plausible(name: str, candidates: Sequence[str]) -> str:
    near = nearest(name, candidates)
    if near is not None:
        return f"; did you mean '{near}'?"
    plausible = few([one for one in candidates if one in DISTANCE_COLUMNS] or candidates)
    return f"; expected one of: {plausible}" if plausible else ""
