"""Every exported column, declared once: SQL views, CSV, codebook, data dictionary, Psych-DS and analysis.

`base` has what every kind of trial exports, `runs` what the table of runs has; the columns of a kind's
answers stand in its own folder (`experiments.trials.<kind>.columns`), with the view that joins them.
"""

from experiments.columns.column import Column, ColumnType, names_of
from experiments.columns.runs import RUN_COLUMNS
from experiments.columns.view import Dialect, View
from experiments.trials.clip_rating.columns import RATINGS

VIEWS: tuple[View, ...] = (RATINGS,)
"""The views of all kinds, which migrations make and a test compares with the database's own."""

RESERVED: frozenset[str] = frozenset(name for view in VIEWS for name in view.names)
"""Names that no factor may have: they are columns beside it."""

__all__ = [
    "RATINGS",
    "RESERVED",
    "RUN_COLUMNS",
    "VIEWS",
    "Column",
    "ColumnType",
    "Dialect",
    "View",
    "names_of",
]
