"""Which columns and rows of the server's exports the analysis reads."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.text_table import NAMED_ROWS, TextTable, flags
from experiments.columns import View, names_of
from experiments.columns.base import LEVELS, RUN, STUDY
from experiments.errors import InputError, counted

# Which columns the analysis reads of the rows of a kind of trial.

_NOT_ASKED = ("run", "language")
_OF_A_RUN = tuple(column for column in (*STUDY, *RUN) if column.name not in _NOT_ASKED)
RUN_TEXTS = names_of(_OF_A_RUN, "text", "integer")
RUN_FLAGS = names_of(_OF_A_RUN, "boolean")
"""Columns that are the same for all rows of a run."""

TRIAL_TEXTS = ("run", "kind", "verdict", "scale")
TRIAL_NUMBERS = ("expected_response", "rt")
TRIAL_PLACES = ("trial_index", "play")
"""These only find repeated rows, which the database's unique index rules out: a CSV alone has to be asked."""


@dataclass(frozen=True)
class Reading:
    """The columns a plan needs in addition to those of every study; only `beside` may be missing.

    Attributes
    ----------
    view : View
        Of the kind of trial, whose columns they are.
    texts, numbers : tuple of str
        Columns that are read as names, and as numbers with NaN for none.
    beside : tuple of str
        Names that a table may lack.
    further : tuple of str
        Numbers that only the slow parts of a report need; absent from a database unless asked for.
    """

    view: View
    texts: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    @property
    def has_levels(self) -> bool:
        """Whether a row is of one clip, so that it has a level of each factor."""
        return LEVELS.name in self.view.names

    @property
    def all_texts(self) -> tuple[str, ...]:
        """Text columns of a trial that the view has."""
        return self._there((*TRIAL_TEXTS, *self.texts, *self.beside))

    @property
    def all_numbers(self) -> tuple[str, ...]:
        """Columns of numbers of a trial that the view has."""
        return self._there((*self.numbers, *TRIAL_NUMBERS))

    def _there(self, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for name in names if name in self.view.names))


# Which rows of the server's export are answers that count.

EXPORT_COLUMNS = ("kind", "verdict", "excluded", "synthetic", "scale", "data_series", "run_origin")
_COUNT = (
    ("kind", ("main", ""), "practice or attention trial"),
    ("verdict", ("good", "uncertain", "flagged", ""), "failed play"),
)


def rows_that_count(
    rows: pd.DataFrame, keep: NDArray[np.bool_], source: str
) -> tuple[NDArray[np.bool_], list[str]]:
    """Those rows among `keep` (n,) that count, and a sentence for each reason that leaves some out."""
    decisions = []
    bad = [
        (~rows[column].astype(str).isin(good).to_numpy(), what)
        for column, good, what in _COUNT
        if column in rows.columns
    ]
    if "excluded" in rows.columns:
        bad.append((flags(rows["excluded"], source), "row"))
    for marked, what in bad:
        out = keep & marked
        if out.any():
            of = " of manually excluded runs" if what == "row" else ""
            decisions.append(f"{counted(int(out.sum()), what)}{of} excluded")
        keep = keep & ~out
    return keep, decisions


def report_visits(table: TextTable, keep: NDArray[np.bool_]) -> None:
    """Say of an export that the rows to `keep` (n,) hold several runs of one participant.

    `analysis run` counts the first run that no rule excludes; a table alone does not say which that is.
    """
    if not {"participant", "run"} <= set(table.header):
        return
    pairs = table.read_again(["participant", "run"])[keep].drop_duplicates()
    times = pairs["participant"].value_counts()
    again = sorted(str(name) for name in times.index[times > 1])
    if again:
        rest = len(again) - NAMED_ROWS
        named = f"{', '.join(again[:NAMED_ROWS])}{f' and {rest} more' if rest > 0 else ''}"
        table.decisions.append(
            f"{counted(len(again), 'participant')} took part more than once ({named}), and the answers of "
            "all runs were counted; `analysis run` counts the first run only"
        )


OF_AN_EXPORT = frozenset({"kind", "trial_index", "run", "verdict", "excluded"})
"""Columns that only the server's own exports have together."""


def rows_with_names(table: TextTable, marks: Set[str] = OF_AN_EXPORT) -> NDArray[np.bool_]:
    """Rows (n,) that need a name in each column used: in an export those that count, else all.

    An instructed answer or a motion check has no clip, so that its row has no level of any factor.
    """
    every = np.ones(len(table.columns), dtype=bool)
    return rows_that_count(table.columns, every, table.source)[0] if marks <= set(table.header) else every


def answers_that_count(
    table: TextTable,
    keep: NDArray[np.bool_],
    what: str,
    used: Sequence[str],
    marks: Set[str] = OF_AN_EXPORT,
) -> NDArray[np.bool_]:
    """Those rows among `keep` (n,) that count, if the table is an export of the server.

    Anyone else's table keeps all its rows: their column `kind` may be a factor, so a table is an export only
    if it has all the columns `marks`. Each reason that leaves rows out is added to the table's decisions.

    Raises
    ------
    InputError
        An export without any such row (`what` names the rows, such as `ratings`), or with answers that have
        no common mean (`refuse_mixed`); `used` are the columns that the analysis separates or compares.
    """
    if not marks <= set(table.header):
        return keep
    keep, left_out = rows_that_count(table.columns, keep, table.source)
    table.decisions.extend(left_out)
    if not keep.any():
        raise InputError(f"{table.source}: there are no usable {what}; {', '.join(left_out)}")
    refuse_mixed(table, keep, used)
    report_visits(table, keep)
    return keep


def repeats_said(number: int, of: str) -> str:
    """The decision about rows that repeat trials."""
    return f"{counted(number, 'repeated row')} of {of} {'was' if number == 1 else 'were'} counted once"


def refuse_mixed(table: TextTable, keep: NDArray[np.bool_], used: Sequence[str]) -> None:
    """Refuse an export whose rows to `keep` (n,) have no common mean (`said_of_mixed`) as one InputError."""
    if said := said_of_mixed(table, keep, used):
        raise InputError(f"{table.source}: {said}")


def said_of_mixed(table: TextTable, keep: NDArray[np.bool_], used: Sequence[str]) -> str | None:
    """What is mixed in the rows to `keep` (n,) of an export, and what to do: scales, series or origins.

    Columns that are `used` separate or compare what they mix. None where the rows have a common mean.
    """
    for column, one, advice in _APART:
        if column in table.columns.columns and column not in used:
            values = sorted({str(name) for name in table.columns[column][keep].unique()} - {""})
            # Answers of a pilot may be pooled with those of participants; simulated ones are no person's.
            mixed = "simulated" in values if column == "run_origin" else True
            if mixed and len(values) > 1:
                return f"expected answers {one}, got {len(values)} ({', '.join(values)}); {advice}"
    return None


_APART = (
    (
        "scale",
        "on one scale",
        "keep the rows of one, or use `analysis run`, or --by scale (opinion, agreement)",
    ),
    (
        "data_series",
        "of one data series",
        "export one with `server export STUDY --series N`, or, to pool them on purpose, remove the column "
        "data_series",
    ),
    ("run_origin", "of one origin", "export one with `server export STUDY --origin participant`"),
)
"""Columns of an export whose values must not be pooled, what is expected, and what to do."""


# Failures of the analysis that are nobody's fault.


class NoRatingsError(InputError):
    """There is nothing to analyze (yet): an empty study, not a fault. Commands end with exit code 1."""
