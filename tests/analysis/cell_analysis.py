"""The complete analysis of a table of cell means, for tests of what reports make of it."""

from typing import Any

from analysis.plans.result import Analysis, analysis_of
from analysis.within.anova import linear_anova
from analysis.within.between import BetweenDesign, no_groups
from analysis.within.cell_means import CellTable


def analyse_cells(cells: CellTable, between: BetweenDesign | None = None, **about: Any) -> Analysis:
    """Test the cell means, in one group unless `between` has others; `about` is passed to `analysis_of`."""
    design = between or no_groups(len(cells.y))
    return analysis_of(cells, linear_anova(cells.y, cells.factors, cells.levels, design), **about)
