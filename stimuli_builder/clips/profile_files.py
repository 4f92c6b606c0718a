"""Blinks from files of closure samples at 300 fps: a table of profiles, or one blink alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.errors import InputError, nearest
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
    (right eye), `lower_up_mm` and `lower_nasal_mm`; or numbers alone, one a line.

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


def _table(path: Path) -> pd.DataFrame:
    """The cells as they are written, without blank lines at the end."""
    if not path.is_file():
        raise InputError(f"{path}: expected a CSV file of closure samples, found none; check the path")
    try:
        table = _cells(path)
        if all(_is_number(str(name)) for name in table.columns):
            table = _cells(path, header=None, names=["closure"])
    except (ValueError, UnicodeDecodeError, OSError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path.name}: not a CSV file that can be read ({reason})") from error
    if not isinstance(table.index, pd.RangeIndex):
        raise InputError(f"{path.name}: expected as many values in a line as there are columns, got more")
    filled = np.flatnonzero((table != "").any(axis=1))
    return table.iloc[: filled[-1] + 1 if len(filled) else 0]


def _cells(path: Path, **more: Any) -> pd.DataFrame:
    """Text of every cell: messages quote it, and a blank line among samples is a sample that is missing."""
    table: pd.DataFrame = pd.read_csv(path, dtype=str, keep_default_na=False, skip_blank_lines=False, **more)
    return table


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _numbers(path: Path, table: pd.DataFrame, name: str) -> Array:
    values = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        text = table[name].iloc[int(wrong[0])]
        raise InputError(f"{path.name}: {name} must be a number, sample {wrong[0] + 1} is '{text}'")
    return values


def _require_closure(path: Path, name: str, values: Array) -> None:
    outside = np.flatnonzero((values < 0) | (values > 1))
    if len(outside):
        raise InputError(
            f"{path.name}: {name} must lie between 0 (open) and 1 (closed), sample {outside[0] + 1} is "
            f"{values[outside[0]]:g}"
        )
