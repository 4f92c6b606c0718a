"""The analysis of paired comparisons: abilities of the cells, what their factors do, order, ties and fit."""

import numpy as np
import pandas as pd

from analysis.pairs.findings import findings_of
from analysis.plans.plan import Plan
from analysis.plans.prepare import refuse_unknown
from analysis.plans.prepared import Prepared
from analysis.plans.study_comparisons import cells_of, comparisons_of, factors_of, looked_up
from analysis.read.reading import Reading
from analysis.report.contents import Contents
from experiments.assignment.groups import groups
from experiments.definition import Experiment
from experiments.trials.paired_comparison.answer import CODES
from experiments.trials.paired_comparison.columns import COMPARISONS
from experiments.trials.paired_comparison.declaration import paired_comparison_of

READING = Reading(COMPARISONS, texts=("winner", "left_cell", "right_cell", "arrangement"))


def numbered(rows: pd.DataFrame) -> pd.DataFrame:
    """Add the number of each answer, as its key has it: 1 left, 2 right, 3 tie."""
    return rows.assign(response=looked_up(rows["winner"], CODES, np.nan))


def check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    """Refuse a winner that is none, a tie where none is declared, and an unknown cell."""
    answers = ["left", "right", *(["tie"] if paired_comparison_of(experiment).ties else [])]
    refuse_unknown(rows, "winner", [*answers, ""], f"answer ({', '.join(answers)})", source)
    cells = [name for name, _ in cells_of(experiment)]
    for column in ("left_cell", "right_cell"):
        refuse_unknown(rows, column, cells, "cell of this experiment", source)


def analyse(prepared: Prepared) -> Contents:
    """Abilities of the cells and all that goes with them, in each group where groups see different cells."""
    if len(groups(prepared.experiment)) > 1:
        from analysis.plans.pairs_in_groups import contents_of_groups

        return contents_of_groups(prepared, analyse)
    from analysis.report.pairs_contents import contents_of

    comparisons = comparisons_of(prepared)
    factors = factors_of(prepared.experiment, comparisons.items)
    return contents_of(prepared, comparisons, findings_of(comparisons, factors), factors)


PLAN = Plan(READING, check, analyse, numbered)
