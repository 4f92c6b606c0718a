"""The choice of a word in the analysis: how often the second was chosen in each cell."""

import pandas as pd
from experiments.kinds.word_choice import KIND

from analysis.plans.plan import Plan, PlanRows
from analysis.read.reading import Reading
from analysis.report.contents import Contents, Part, caption
from analysis.report.formats import Table
from analysis.report.json_output import left_out
from analysis.report.numbers import fixed
from experiments.declaration.experiment import Experiment


def numbered(rows: pd.DataFrame) -> pd.DataFrame:
    """1 for the first word, 2 for the second, as attention checks ask for them."""
    return rows.assign(response=rows["word"].map({"first": 1.0, "second": 2.0}).astype(float))


def check(_experiment: Experiment, _rows: pd.DataFrame, _source: str) -> None:
    """Every row fits."""


def analyse(prepared: PlanRows) -> Contents:
    """The share of the second word, of each person first."""
    experiment, rows = prepared.experiment, prepared.rows
    factors = list(experiment.factor_names)
    of_people = rows.groupby([*factors, "participant"], observed=True)["response"].mean() - 1
    shares = of_people.groupby(factors, observed=True).mean()
    cells = [tuple(map(str, key if isinstance(key, tuple) else (key,))) for key in shares.index]
    table = Table(
        "words",
        caption("Share of the second word", experiment.name, prepared.synthetic),
        (*factors, "Share"),
        tuple((*cell, fixed(share)) for cell, share in zip(cells, shares, strict=True)),
    )
    people = rows["participant"].nunique()
    return Contents(
        name=experiment.name,
        title=experiment.title,
        lead=f"{people} participants",
        source=prepared.source,
        synthetic=prepared.synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=prepared.decisions,
        parts=(
            Part((table,), (f"The second word was chosen in {fixed(100 * shares.mean(), 0)}% of plays.",)),
        ),
        methods="Shares of the second word were averaged over people.",
        numbers={"shares": {"/".join(c): float(s) for c, s in zip(cells, shares, strict=True)}, "n": people},
    )


PLAN = Plan(Reading(KIND.view, texts=("word",)), check, analyse, numbered)
