"""The toy in the analysis: the share of pairs that looked alike."""

import pandas as pd

from analysis.plans.plan import Plan, PlanRows
from analysis.read.reading import Reading
from analysis.report.contents import Contents, Part, caption
from analysis.report.formats import Table
from analysis.report.json_output import left_out
from analysis.report.numbers import fixed
from experiments.declaration.experiment import Experiment
from tests.experiments.trials.toy import TOY


def numbered(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(response=rows["same"])


def check(_experiment: Experiment, _rows: pd.DataFrame, _source: str) -> None:
    return None


def analyse(prepared: PlanRows) -> Contents:
    share, people = float(prepared.rows["same"].mean()), prepared.rows["participant"].nunique()
    name, synthetic = prepared.experiment.name, prepared.synthetic
    table = Table("alike", caption("Alike", name, synthetic), ("Pairs", "Share"), (("all", fixed(share)),))
    return Contents(
        name=name,
        title=prepared.experiment.title,
        lead=f"{people} participants",
        source=prepared.source,
        synthetic=synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=prepared.decisions,
        parts=(Part((table,), (f"Of the pairs {fixed(100 * share, 0)}% looked alike.",)),),
        methods="A share.",
        numbers={"share": share, "n": len(prepared.rows), "synthetic": synthetic},
    )


PLAN = Plan(Reading(TOY.view, numbers=("same",)), check, analyse, numbered)
