"""Every exported column, declared once: SQL views, CSV, codebook, data dictionary, Psych-DS and analysis.

`base` has what every kind of trial exports, `runs` what the table of runs has; the columns of a kind's
answers are in its folder (`experiments.kinds.<kind>.columns`), with the view that joins them.
"""

from experiments.columns.column import Column, ColumnType, names_of
from experiments.columns.runs import RUN_COLUMNS
from experiments.columns.view import Dialect, View

__all__ = ["RUN_COLUMNS", "Column", "ColumnType", "Dialect", "View", "names_of"]
