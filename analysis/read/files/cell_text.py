"""The text of a value, as a person would type it; free of pandas, for readers that start anew."""

from datetime import date, datetime, time
from typing import Any

import numpy as np


def cell_text(value: Any) -> str:
    """A value of a sheet as a person would type it: whole numbers without a point, days as 2026-11-22."""
    if value is None or value != value:  # NaN, and pandas' time that is none
        return ""
    if isinstance(value, bool | np.bool_):
        return str(bool(value))
    if isinstance(value, float | np.floating):
        number = float(value)
        return str(int(number)) if number.is_integer() and abs(number) < 1e15 else repr(number)
    if isinstance(value, datetime):
        return value.date().isoformat() if value.time() == time() else value.isoformat(" ")
    return value.isoformat() if isinstance(value, date | time) else str(value)
