"""What a plan analyses: a study's answers that count, whatever its kind of trial."""

from dataclasses import dataclass, field

import pandas as pd

from analysis.plans.exclusions import Exclusions
from analysis.read.study_answers import StudyAnswers
from experiments.definition import Experiment


@dataclass(frozen=True)
class Prepared:
    """What a plan analyses: the main trials that count, what was left out, and every decision on the way."""

    experiment: Experiment
    source: str
    synthetic: bool
    exclusions: Exclusions
    decisions: tuple[str, ...]
    checked: StudyAnswers = field(repr=False)
    """The answers before exclusion."""
    scale: str | None = None
    """The scale to analyse, where not all are."""

    @property
    def rows(self) -> pd.DataFrame:
        """Main trials with an answer, of the runs that remain."""
        return self.exclusions.rows
