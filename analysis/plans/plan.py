"""What the data of a kind of trial can be asked: a file of its name here, with `PLAN`.

Nothing else joins them: the name in the declaration finds the file.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import pandas as pd

from analysis.read.reading import Reading
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.plans.prepared import Prepared
    from analysis.report.contents import Contents
    from experiments.definition import Experiment


def as_they_are(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows whose answer stands as a number in `response` already."""
    return rows


@dataclass(frozen=True)
class Plan:
    """The analysis of a kind of trial.

    Attributes
    ----------
    reading : Reading
        The columns it needs of the kind's view.
    check : callable
        Refuses main rows that the declaration does not allow, by participant and trial; the last argument
        names the source.
    analyse : callable
        The tests, and what the report says of them.
    numbered : callable
        Adds `response`, the answer as a number, which exclusion rules and attention checks go by.
    keys : tuple of str
        Columns that tell apart the rows of one play, where a play has several.
    """

    reading: Reading
    check: "Callable[[Experiment, pd.DataFrame, str], None]"
    analyse: "Callable[[Prepared], Contents]"
    numbered: Callable[[pd.DataFrame], pd.DataFrame] = as_they_are
    keys: tuple[str, ...] = ()


def plan_of(kind: str) -> Plan:
    """The plan of a kind of trial; InputError where it has none."""
    module = f"analysis.plans.{kind}"
    try:
        plan: Plan = import_module(module).PLAN
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        raise InputError(
            f"trials of the kind {kind} have no analysis yet; export their data (server export)"
        ) from error
    return plan
