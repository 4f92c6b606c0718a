"""Frames of which their table itself says that they are not to be believed."""

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError
from stimuli_builder.blinks.column_names import eye_of, words_of

VALID_COLUMNS = ("valid", "success")
"""1 where a frame was measured, 0 where not; 'success' is OpenFace's."""
_VALID = frozenset(VALID_COLUMNS)
_OF_ALL = _VALID | {"confidence", "is", "face", "eye", "eyes", "frame", "tracking", "detection", "landmarks"}
"""Words of a validity's name that are of no columns in particular."""
_OF_OTHERS = frozenset({"not", "invalid", "blink", "trial", "task", "response"})
"""With these it says something else than which frames were measured: valid_blink, trial_success."""
CONFIDENCE_COLUMN = "confidence"
LEAST_CONFIDENCE = 0.5
"""Of 0 to 1, as OpenFace writes it beside 'success'; below it a frame is likelier wrong than right."""
_WORDS = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}


def is_validity(name: str) -> bool:
    """Whether a column's name is one of validity: valid, success, EAR2D6_valid, BS_Valid, valid_left."""
    words = [word for word in words_of(name) if eye_of(word) is None]
    return bool(words) and not _VALID.isdisjoint({words[0], words[-1]})


def unseen_rows(
    table: pd.DataFrame, columns: Sequence[str], path: Path
) -> tuple[dict[str, NDArray[np.bool_]], list[str]]:
    """Rows whose values are not to be believed by the table's own columns, and a line about each reason.

    A validity with a side in its name (left_valid) is of that eye's columns alone, one with further words
    (BS_Valid) of the columns whose names begin with them (BS_gap). With more than `VALID_COLUMNS` in its
    name it is heeded where it holds 0 and 1 only, and a blank says nothing there.

    Parameters
    ----------
    columns : sequence of str
        The series that are labelled.

    Returns
    -------
    unseen : dict of str to (rows,) bool array
        By column of `columns`.
    notes : list of str

    Raises
    ------
    InputError
        A column of `VALID_COLUMNS` holds something else than 0 and 1, one of confidence is not from 0 to 1,
        or no row of a series is left.
    """
    unseen = {column: np.zeros(len(table), np.bool_) for column in columns}
    notes = []
    for name in map(str, table.columns):
        rows, why = _doubted(table[name], path)
        heeding = [column for column in columns if _is_about(name, column)]
        if not rows.any() or not heeding:
            continue
        eye = "" if len(heeding) == len(columns) else f" of {', '.join(heeding)}"
        notes.append(f"{path.name}: {rows.sum():,} of {rows.size:,} frames{eye} {why}: taken as not seen")
        for column in heeding:
            unseen[column] |= rows
    if any(rows.all() for rows in unseen.values()):
        raise InputError(f"{'; '.join(notes)}; nothing is left: take the column out if it is wrong")
    return unseen, notes + _doubtful(table, path)


def _doubted(column: pd.Series, path: Path) -> tuple[NDArray[np.bool_], str]:
    """(rows,) of a validity or confidence that are not to be believed, and why; none of another column."""
    name = str(column.name)
    if name.lower() == CONFIDENCE_COLUMN:
        return _not_sure(column, path), f"have a '{name}' below {LEAST_CONFIDENCE:g}"
    if name.lower() in VALID_COLUMNS:
        return _not_valid(_cells(column, blank="0"), path), f"are not valid by '{name}'"
    if is_validity(name) and not _other_words(cells := _cells(column, blank="1")):
        return _not_valid(cells, path), f"are not valid by '{name}'"
    return np.zeros(column.size, np.bool_), ""


def _is_about(name: str, column: str) -> bool:
    """Whether a validity is one of a series: of its eye, and by no words but such as its name begins with."""
    side, eye = eye_of(name), eye_of(column)
    if not _OF_OTHERS.isdisjoint(words_of(name)) or (side and eye and side != eye):
        return False
    words = _own_words(name)
    beginnings = {*accumulate(words_of(column)), *accumulate(_own_words(column))}
    return not words or "".join(words) in beginnings


def _own_words(name: str) -> list[str]:
    return [word for word in words_of(name) if word not in _OF_ALL and eye_of(word) is None]


def _cells(column: pd.Series, blank: str) -> "pd.Series[str]":
    return column.map(lambda cell: blank if pd.isna(cell) else str(cell).strip().lower())


def _other_words(cells: "pd.Series[str]") -> list[str]:
    """What a column holds beside 0 and 1, true and false."""
    return [word for word in cells.unique() if word not in _WORDS]


def _not_valid(words: "pd.Series[str]", path: Path) -> NDArray[np.bool_]:
    if other := _other_words(words):
        raise InputError(
            f"{path.name}: column '{words.name}' says which frames are valid by 1 and 0 (true and false), "
            f"got '{other[0]}'; name it otherwise if it says something else"
        )
    return ~words.map(_WORDS).to_numpy(dtype=np.bool_)


def _not_sure(column: pd.Series, path: Path) -> NDArray[np.bool_]:
    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=np.float64)
    words = column[np.isnan(values) & column.notna().to_numpy()]
    if words.size:
        raise InputError(
            f"{path.name}: column '{column.name}' must hold numbers between 0 and 1, got {words.iloc[0]!r}; "
            "mend it, or name it otherwise"
        )
    if (values < 0).any() or (values > 1).any():
        raise InputError(
            f"{path.name}: column '{column.name}' must lie between 0 and 1, got "
            f"{np.nanmin(values):g} to {np.nanmax(values):g}; divide it, or name it otherwise"
        )
    return np.asarray(~(values >= LEAST_CONFIDENCE))


def _doubtful(table: pd.DataFrame, path: Path) -> list[str]:
    """A line about the frames whose points a track doubts: they are given, and may be wrong."""
    count = int((table["status"] == "doubtful").sum()) if "status" in table.columns else 0
    if not count:
        return []
    return [
        f"{path.name}: {count:,} of {len(table):,} frames are doubtful: labelled as they are, their points "
        "may be wrong"
    ]
