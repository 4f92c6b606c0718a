"""Which rows of the server's export are answers that count."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

EXPORT_COLUMNS = ("kind", "verdict", "excluded", "synthetic")
_COUNT = (
    ("kind", ("main", ""), "practice and attention trials"),
    ("verdict", ("good", "uncertain", "flagged", ""), "failed plays"),
    ("excluded", ("0", "False", "false", ""), "rows of runs excluded by hand"),
)


def rows_that_count(rows: pd.DataFrame, keep: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], list[str]]:
    """Of the rows to `keep` (n,) those that count, and a sentence for each reason that leaves some out."""
    decisions = []
    for column, good, why in _COUNT:
        if column not in rows.columns:
            continue
        out = keep & ~rows[column].astype(str).isin(good).to_numpy()
        if out.any():
            decisions.append(f"{out.sum()} {why} left out")
        keep = keep & ~out
    return keep, decisions
