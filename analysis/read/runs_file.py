"""The runs CSV (`server export --format runs`): the verdict on each run, and the signals behind it."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.read.number_columns import MISSING_MARKS
from analysis.read.study_answers import StudyAnswers
from analysis.read.text_table import read_text_table
from experiments.columns.runs import EVIDENCE_COLUMNS

VERDICT = "evidence_verdict"


@dataclass(frozen=True)
class RunEvidence:
    """Verdict of each run by its name, and the signals as columns of numbers, NaN for none."""

    verdicts: dict[str, str]
    signals: pd.DataFrame


def read_runs(path: Path) -> RunEvidence:
    """Read the columns on evidence of a runs CSV.

    Raises
    ------
    InputError
        As `read_text_table`: no file, or no columns `run` and `evidence_verdict`.
    """
    names = [column.name for column in EVIDENCE_COLUMNS]
    rows = read_text_table(path, ["run", VERDICT], names, copies=False).columns
    runs = rows["run"].astype(str).tolist()
    signals = {name: _numbers(rows[name].astype(str)) for name in names if name in rows.columns}
    return RunEvidence(
        dict(zip(runs, rows[VERDICT].astype(str), strict=True)),
        pd.DataFrame(signals, index=pd.Index(runs, name="run")),
    )


def _numbers(column: pd.Series) -> np.ndarray:
    return np.array([np.nan if text in MISSING_MARKS else float(text) for text in column])


def with_verdicts(answers: StudyAnswers, runs: RunEvidence) -> StudyAnswers:
    """The answers with the verdicts of the runs file, which were given when it was written."""
    if "run" not in answers.rows.columns:
        return answers
    verdicts = answers.rows["run"].astype(str).map(runs.verdicts).fillna("not_judged")
    return replace(answers, rows=answers.rows.assign(**{VERDICT: pd.Categorical(verdicts)}))
