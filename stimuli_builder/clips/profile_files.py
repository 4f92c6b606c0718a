"""Blinks from files of closure samples at 300 fps: a table of profiles, or one blink alone."""

from pathlib import Path

import numpy as np
import pandas as pd

from experiments.errors import InputError, nearest
from stimuli_builder.blinks.csv_table import NOTE, read_table
from stimuli_builder.blinks.profile import Array, BlinkProfile
from stimuli_builder.blinks.profile_table import read_profile_table

COLUMNS = ("closure", "closure_other", "lower_up_mm", "lower_nasal_mm")
NEAR = 0.7
"""Below it `score` would be taken for `closure`."""
FORMATS = (
    "expected one blink (a column closure, 0 open to 1 closed, at 300 fps) or a table of profiles "
    "(NAME.profiles.csv of `stimuli blinks`, with a column profile_id)"
)


def read_closure_file(path: Path) -> list[BlinkProfile]:
    """Read blinks from a CSV file.

    A file with a column `profile_id` is a table of profiles as `stimuli blinks` writes it. Any other
    holds one blink: a column `closure` (0 open, 1 closed) at 300 fps, and where wanted `closure_other`
    (right eye), `lower_up_mm` and `lower_nasal_mm`; or numbers alone, one a line. Semicolons, tabs and
    decimal commas are read as in a series (`stimuli_builder.blinks.csv_table`).

    Raises
    ------
    InputError
        The file is missing, has no closure, or a sample is no number between 0 and 1.
    """
    table = _table(path)
    if "profile_id" in table.columns:
        return read_profile_table(path)
    if "closure" not in table.columns:
        near = nearest("closure", [str(name) for name in table.columns if name not in COLUMNS], NEAR)
        hint = f"did you mean '{near}'?" if near else FORMATS
        raise InputError(f"{path.name}: no column 'closure'; {hint}")
    signals = {name: _numbers(path, table, name) for name in COLUMNS if name in table.columns}
    closure = signals["closure"]
    if len(closure) < 3:
        raise InputError(f"{path.name}: expected at least 3 samples of closure, found {len(closure)}")
    for name, values in signals.items():
        if name.startswith("closure"):
            _require_closure(path, name, values)
    minimum = int(np.argmax(closure))
    if not 0 < minimum < len(closure) - 1:
        raise InputError(
            f"{path.name}: the greatest closure must lie inside the blink, it is sample {minimum + 1} "
            f"of {len(closure)}; add the closing and the opening"
        )
    return [
        BlinkProfile(
            profile_id=f"file-{path.stem}",
            closure=closure,
            minimum_index=minimum,
            down_frames=minimum,
            up_frames=len(closure) - 1 - minimum,
            amplitude=float(np.ptp(closure)),
            source=f"file {path.name}",
            eye="both" if "closure_other" in signals else None,
            closure_other=signals.get("closure_other"),
            lower_up_mm=signals.get("lower_up_mm"),
            lower_nasal_mm=signals.get("lower_nasal_mm"),
        )
    ]


def reading_note(path: Path) -> str:
    """How the cells of such a file were read, where that is not plain: for the person who gave it to see."""
    return str(_table(path).attrs.get(NOTE, ""))


def _table(path: Path) -> pd.DataFrame:
    """The cells, without blank lines at the end; one among samples is a sample that is missing."""
    table = read_table(path, alone="closure", as_written=True)
    filled = np.flatnonzero(table.notna().any(axis=1))
    return table.iloc[: filled[-1] + 1 if len(filled) else 0]


def _numbers(path: Path, table: pd.DataFrame, name: str) -> Array:
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        # Beside a word decimal commas are still commas; the word is what is wrong.
        cells = table[name].astype(str).str.replace(",", ".")
        words = np.flatnonzero(pd.to_numeric(cells, errors="coerce").isna())
        sample = int([*words, *wrong][0])
        cell = table[name].iloc[sample]
        said = "missing" if pd.isna(cell) else f"'{cell}'"
        raise InputError(f"{path.name}: {name} must be a number, sample {sample + 1} is {said}")
    return values


def _require_closure(path: Path, name: str, values: Array) -> None:
    outside = np.flatnonzero((values < 0) | (values > 1))
    if len(outside):
        raise InputError(
            f"{path.name}: {name} must lie between 0 (open) and 1 (closed), sample {outside[0] + 1} is "
            f"{values[outside[0]]:g}"
        )
