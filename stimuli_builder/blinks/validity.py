"""Frames of which their table itself says that they are not to be believed."""

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.errors import InputError

VALID_COLUMNS = ("valid", "success")
"""1 where a frame was measured, 0 where not; 'success' is OpenFace's."""
CONFIDENCE_COLUMN = "confidence"
LEAST_CONFIDENCE = 0.5
"""Of 0 to 1, as OpenFace writes it beside 'success'; below it a frame is likelier wrong than right."""
_WORDS = {"true": True, "1": True, "1.0": True, "false": False, "0": False, "0.0": False}


def unseen_rows(table: pd.DataFrame, path: Path) -> tuple[NDArray[np.bool_], list[str]]:
    """Rows whose values are not to be believed by the table's own columns, and a line about each reason.

    Raises
    ------
    InputError
        A column of `VALID_COLUMNS` holds something else than 0 and 1, one of confidence is not from 0 to 1,
        or no row is left.
    """
    unseen = np.zeros(len(table), np.bool_)
    notes = []
    for name in table.columns:
        if name.lower() in VALID_COLUMNS:
            rows, why = _not_valid(table[name], path), f"are not valid by '{name}'"
        elif name.lower() == CONFIDENCE_COLUMN:
            rows, why = _not_sure(table[name], path), f"have a '{name}' below {LEAST_CONFIDENCE:g}"
        else:
            continue
        if rows.any():
            notes.append(f"{path.name}: {rows.sum():,} of {rows.size:,} frames {why}: taken as not seen")
        unseen |= rows
    if unseen.all():
        raise InputError(f"{'; '.join(notes)}; nothing is left: take the column out if it is wrong")
    return unseen, notes + _doubtful(table, path)


def _not_valid(column: pd.Series, path: Path) -> NDArray[np.bool_]:
    words = column.map(lambda cell: "0" if pd.isna(cell) else str(cell).strip().lower())
    other = [word for word in words.unique() if word not in _WORDS]
    if other:
        raise InputError(
            f"{path.name}: column '{column.name}' says which frames are valid by 1 and 0 (true and false), "
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
