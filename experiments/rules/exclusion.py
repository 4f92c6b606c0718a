"""What a rule of [[exclusions]] is: it leaves out whole runs, or single trials, by the data they gave.

A rule is one file: its keys, and a method that judges. The analysis asks it, whatever the kind of trial.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import ClassVar, Literal

from experiments.base import Declaration

Source = Literal["rows", "plays", "attention"]


@dataclass(frozen=True)
class RunTrials:
    """Columns of one run's trials: text, and numbers with NaN where there is none.

    `response` is the answer as a number, whatever the kind of trial: the point of a scale, or the number of
    the answer's key.
    """

    columns: Mapping[str, Sequence[str] | Sequence[float]]

    def texts(self, name: str) -> list[str]:
        """Every value of a column of text."""
        return [str(value) for value in self.columns[name]]

    def numbers(self, name: str) -> list[float]:
        """Every value of a column of numbers, NaN included."""
        return [float(value) for value in self.columns[name]]

    def given(self, name: str) -> list[float]:
        """The numbers there are in a column."""
        return [value for value in self.numbers(name) if not isnan(value)]


class LeavesOutRuns(Declaration):
    """A rule about runs: its method `excludes(run: RunTrials) -> str | None` gives the reason in words.

    Attributes
    ----------
    needed : tuple of str
        Columns it reads; where the data lack one the report says that the rule was not applied.
    source : {"rows", "plays", "attention"}
        All rows of the run, main trials of which nothing is left out, or attention checks.
    """

    needed: ClassVar[tuple[str, ...]]
    source: ClassVar[Source] = "plays"


class LeavesOutTrials(Declaration):
    """A rule about single trials: its method `drops(value) -> bool` judges the trial's value in a column.

    Attributes
    ----------
    needed : str
        The column; where the data lack it the report says that the rule was not applied.
    """

    needed: ClassVar[str]
