"""Files of a folder that were joined of others of it, known by what their cells say, not by their bytes."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pandas as pd

NOTHING = frozenset({"", "na", "nan", "null", "none", "n/a"})
FEWEST_KINDS = 6
"""Rows of fewer kinds than this may be as many as those of others together by chance."""


class Joined(NamedTuple):
    """A file that holds the rows of two others or more and none beside; `kinds` of them are distinct."""

    file: Path
    parts: tuple[Path, ...]
    kinds: int


def row_counts(rows: pd.DataFrame) -> Counter[int]:
    """How often each row is there; rows are alike whose numbers are (3 and 3.0), and blank ones are none."""
    alike = rows.apply(lambda column: column.map({text: _meaning(text) for text in column.unique()}))
    filled = alike[(alike != "").any(axis=1)]
    return Counter(pd.util.hash_pandas_object(filled, index=False).tolist())


def joined_of(counts: Mapping[Path, Counter[int]]) -> Joined | None:
    """The largest file whose rows are those of two others or more, copies of a file taken once.

    `counts` has of each file its rows in the columns that all files share, as of `row_counts`.
    """
    by_size = sorted(counts, key=lambda name: counts[name].total(), reverse=True)
    for position, name in enumerate(by_size):
        left, parts = Counter(counts[name]), []
        for other in by_size[position + 1 :]:
            # one of the same size is a copy, and makes no joined file of this one
            if 0 < counts[other].total() < counts[name].total() and counts[other] <= left:
                left -= counts[other]
                parts.append(other)
        if len(parts) > 1 and not left:
            return Joined(name, tuple(sorted(parts)), len(counts[name]))
    return None


def _meaning(text: str) -> str:
    """A cell as it is compared: 3.0 and 3,0 as 3, TRUE as true, NA as nothing."""
    text = text.strip().casefold()
    if text in NOTHING:
        return ""
    try:
        return f"{float(text.replace(',', '.')):.12g}"
    except ValueError:
        return text
