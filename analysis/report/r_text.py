"""Numbers and rows as R reads them."""

import csv
import io
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np


def r_number(value: float | None) -> str:
    """A number as R reads it; NA where there is none."""
    return "NA" if value is None or not np.isfinite(value) else repr(float(value))


def as_csv(rows: Iterable[Sequence[Any]]) -> str:
    """Rows as CSV text."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def head_of_script(title: str, script: str, data: str) -> dict[str, str]:
    """What every script says first: of which report it is, who wrote it, its name and its data."""
    return {"title": " ".join(title.split()), "version": version("palpebra"), "script": script, "data": data}
