"""What a report says of the evidence that answers are a person's: verdicts counted, signals summed up."""

from typing import Any

import pandas as pd

from analysis.read.study_answers import VERDICT, RunEvidence
from analysis.report.contents import Section, mark_name
from analysis.report.formats import Table
from experiments.columns.base import VERDICTS
from experiments.columns.runs import EVIDENCE_COLUMNS

TITLE = "Evidence that responses are from a person"
ABOUT = (
    "Each run has one verdict. It is based on the tickets, times, digests and key presses that came with "
    "the responses. A verdict is evidence, not proof: it cannot detect a person who lets a program choose "
    "the responses. Runs without evidence are not judged. A verdict excludes no one unless a rule of the "
    "study says so."
)


def verdict_counts(rows: pd.DataFrame) -> dict[str, int]:
    """How many runs of these rows have each verdict; empty where the data do not say."""
    if VERDICT not in rows.columns or "run" not in rows.columns:
        return {}
    verdicts = rows[["run", VERDICT]].drop_duplicates("run")[VERDICT].astype(str)
    counts = verdicts.replace("", "not_judged").value_counts()
    return {verdict: int(counts.get(verdict, 0)) for verdict in VERDICTS}


def evidence_section(
    rows: pd.DataFrame, runs: RunEvidence | None, synthetic: bool
) -> tuple[Section | None, dict[str, Any]]:
    """The section, and its numbers as the JSON has them; nothing where the data have no verdicts."""
    counts = verdict_counts(rows)
    if not counts:
        return None, {}
    numbers: dict[str, Any] = {"verdicts": counts}
    tables = [
        Table(
            "evidence-verdicts",
            mark_name("Runs by verdict, before exclusions", synthetic),
            ("Verdict", "Runs"),
            tuple((verdict.replace("_", " "), str(number)) for verdict, number in counts.items()),
        )
    ]
    if runs is not None:
        numbers["signals"] = summaries(runs.signals.loc[runs.signals.index.isin(rows["run"].astype(str))])
        tables += [_signals(numbers["signals"], synthetic)] if numbers["signals"] else []
    return Section(TITLE, ABOUT, tuple(tables)), numbers


def summaries(signals: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Number of runs, median, least and greatest value of each signal that any run has."""
    by_name: dict[str, dict[str, float]] = {}
    for name in signals.columns:
        values = signals[name].dropna()
        if len(values):
            by_name[name.removeprefix("evidence_")] = {
                "runs": len(values),
                "median": float(values.median()),
                "minimum": float(values.min()),
                "maximum": float(values.max()),
            }
    return by_name


def _signals(signals: dict[str, dict[str, float]], synthetic: bool) -> Table:
    columns = {column.name.removeprefix("evidence_"): column for column in EVIDENCE_COLUMNS}
    said = {name: f"{name}: {one.description}" for name, one in columns.items()}
    said |= {name: f"{said[name]} In {one.unit}." for name, one in columns.items() if one.unit}
    rows = tuple(
        (
            said[name],
            f"{one['runs']:.0f}",
            *(f"{one[what]:.3g}" for what in ("median", "minimum", "maximum")),
        )
        for name, one in signals.items()
    )
    return Table(
        "evidence-signals",
        mark_name("Signals of the runs", synthetic),
        ("Signal", "Runs", "Median", "Least", "Greatest"),
        rows,
    )
