"""Anyone's long table for `analysis anova`: read, check, and turn into cell means."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.number_columns import IN_COVARIATE, numbers, unusual_numbers
from analysis.read.reading import EXPORT_COLUMNS, answers_that_count, repeats_said, rows_with_names
from analysis.read.text_table import (
    TextTable,
    name_lines,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from analysis.within.between import BetweenDesign, Covariate, between_design, no_groups
from analysis.within.level_codes import level_codes
from experiments.errors import InputError
from table_files import counted


@dataclass(frozen=True)
class LongData:
    """Rows with columns of text and a numeric rating, and every decision taken while reading."""

    rows: pd.DataFrame
    source: str
    decisions: tuple[str, ...]
    synthetic: bool = False
    header: tuple[str, ...] = ()


def read_long_table(
    path: Path,
    participant: str,
    rating: str,
    within: Sequence[str],
    trial: str | None = None,
    scale: tuple[float, float] | None = None,
    between: Sequence[str] = (),
    covariates: Sequence[str] = (),
) -> LongData:
    """Read one row per trial.

    Parameters
    ----------
    path : Path
        CSV file.
    participant, rating : str
        Columns of ids and of ratings.
    within, between : sequence of str
        Columns of factors, within and between participants.
    trial : str, optional
        Column that identifies a participant's trials.
    scale : (float, float), optional
        Lowest and highest rating.
    covariates : sequence of str
        Columns of numbers that belong to participants; participants without one are left out and named.

    Raises
    ------
    InputError
        As `read_text_table`; a column in two roles; ratings that are text or outside `scale`; one trial
        with two ratings.
    """
    needed = [participant, rating, *within, *between, *covariates, *([trial] if trial else [])]
    refuse_shared_roles(needed)
    # Columns of an export are read as well: they say which answers count.
    table = read_text_table(path, needed, EXPORT_COLUMNS)
    named = rows_with_names(table)
    for name in (participant, *within, *between):
        texts_required(table, name, factor=name != participant, rows=named)
    values = numbers(table, rating)
    # Before rows are left out: a typing error must not hide in them.
    refuse_out_of_scale(table, rating, values, scale)
    unusual_numbers(table, rating, values)
    keep = ~np.isnan(values)
    if not keep.all():
        table.decisions.append(
            f"{counted(int((~keep).sum()), 'row')} without a rating excluded ({name_lines(table, ~keep)})"
        )
    if not keep.any():
        raise InputError(f"{path.name}: column '{rating}' has no rating in any row")
    # With trials named, a repeat is certain; without them it is only suspected.
    if trial is not None:
        keep &= ~_repeats(table, [participant, trial], values, within)
    measured = {name: numbers(table, name) for name in covariates}
    # After the ratings: a participant is left out for a covariate as a whole.
    for name, given in measured.items():
        unusual_numbers(table, name, given, IN_COVARIATE)
        keep &= _with_covariate(table, participant, name, given)
    if not keep.any():
        raise InputError(f"{path.name}: no participant has a rating and all covariates")
    # Last, so that its counts are of rows that would otherwise be used.
    keep = answers_that_count(table, keep, "ratings", needed)
    if trial is None:
        _report_copies(table, needed, values, keep)
    rows = table.columns.assign(**{rating: values, **measured})[keep].reset_index(drop=True)
    return LongData(rows, path.name, tuple(table.decisions), table.synthetic, table.header)


def _with_covariate(
    table: TextTable, participant: str, name: str, given: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Rows of participants whose covariate is known; the others are named."""
    people_of_rows = table.columns[participant].to_numpy()
    # One missing cell leaves out the participant, whose value would be unknown in other rows.
    lacking = list(dict.fromkeys(people_of_rows[np.isnan(given)]))
    if lacking:
        people = f"participant{'s' if len(lacking) > 1 else ''} {', '.join(map(str, lacking))}"
        table.decisions.append(f"excluded because '{name}' is missing: {people}")
    return np.asarray(~np.isin(people_of_rows, lacking), dtype=bool)


def refuse_out_of_scale(
    table: TextTable, rating: str, values: NDArray[np.float64], scale: tuple[float, float] | None
) -> None:
    """Refuse the first rating outside `scale`, naming its line."""
    if scale is None:
        return
    low, high = scale
    outside = (values < low) | (values > high)
    if outside.any():
        row = int(np.argmax(outside))
        raise InputError(
            f"{table.source}: '{rating}' is {values[row]:g} in line {table.line(row)}, "
            f"outside the scale {low:g} to {high:g}"
        )


def _repeats(
    table: TextTable, keys: list[str], values: NDArray[np.float64], within: Sequence[str]
) -> NDArray[np.bool_]:
    """Rows that repeat a trial already there with the same levels and rating; another rating is refused."""
    frame = table.columns[[*keys, *within]].assign(_rating=values)
    # The same trial; `same` also has the same levels and rating.
    again = frame.duplicated(keys).to_numpy()
    same = frame.duplicated().to_numpy()
    if (again & ~same).any():
        row = int(np.argmax(again & ~same))
        which = ", ".join(f"{key} {table.columns[key].iloc[row]}" for key in keys)
        raise InputError(
            f"{table.source}: {which} occurs twice with different data, again in line {table.line(row)}"
        )
    if again.any():
        table.decisions.append(f"{repeats_said(int(again.sum()), 'one trial')} ({name_lines(table, again)})")
    return np.asarray(again, dtype=bool)


def _report_copies(
    table: TextTable, names: list[str], values: NDArray[np.float64], keep: NDArray[np.bool_]
) -> None:
    """Say it where cells of the rows to `keep` (n,) have one trial but a few have more: probably copies."""
    # The second name is the rating; what is left describes the cell it is of.
    cells = table.columns[keep][[n for n in names if n in table.columns]].drop(columns=names[1])
    counts = cells.groupby(list(cells.columns), observed=True).size()
    # Several trials per cell are the rule in other designs, so only the exception is named.
    if counts.median() == 1 and counts.max() > 1:
        copies = cells.assign(_rating=values[keep]).duplicated().to_numpy()
        more = f", {copies.sum()} of them with the same rating" if copies.any() else ""
        table.decisions.append(
            f"most cells have one row, but {int((counts > 1).sum())} have more{more}; all rows were counted "
            "(use --trial with the column of trials to find repeats)"
        )


# Groups and covariates in a long table: columns that hold one value for each participant.

Integers = NDArray[np.int64]


def design_of(
    rows: pd.DataFrame,
    participant: str,
    people: Sequence[str],
    between: Sequence[str],
    covariates: Sequence[str],
    centred: bool = True,
    covariate_by_group: bool = False,
) -> BetweenDesign:
    """The groups and covariates of the participants `people`, in this order.

    Parameters
    ----------
    rows : DataFrame
        One row per trial; `between` columns hold text, `covariates` finite numbers.
    participant : str
        Column of ids.
    people : sequence of str
        Who takes part in the tests.
    between, covariates : sequence of str
        Columns.
    centred : bool
        Whether covariates are centered at their mean over `people`.
    covariate_by_group : bool
        As in `between_design`.

    Raises
    ------
    InputError
        A participant with two values in a column, or as `between_design`.
    """
    # The usual case, without a pass over all rows.
    if not between and not covariates:
        return no_groups(len(people))
    person, everybody = level_codes(rows[participant], participant)
    first = np.zeros(len(everybody), np.int64)
    # Assigned from the last row to the first: what stays is the first row of each participant.
    first[person[::-1]] = np.arange(len(person))[::-1]
    position = {name: i for i, name in enumerate(everybody)}
    # In the order of `people`, which is that of the cell means.
    chosen = np.array([position[one] for one in people], np.int64)
    levels, codes = [], np.zeros((len(people), len(between)), np.int64)
    for k, name in enumerate(between):
        of_rows, own = level_codes(rows[name], name)
        # Checked for all rows, as only the first row of each participant is used below.
        _refuse_two_values(name, of_rows != of_rows[first][person], rows, everybody, person)
        levels.append(own)
        codes[:, k] = of_rows[first[chosen]]
        _refuse_left_out(name, own, codes[:, k], of_rows[first])
    numbers = []
    for name in covariates:
        measured = rows[name].to_numpy(dtype=np.float64)
        # NaN cannot occur: rows without a covariate were left out.
        _refuse_two_values(name, measured != measured[first][person], rows, everybody, person)
        given = measured[first[chosen]]
        # The mean over the participants who stay, not over all who were read.
        numbers.append(Covariate(name, given, float(given.mean()) if centred else 0.0, centred))
    return between_design(between, levels, codes, numbers, covariate_by_group)


def _refuse_left_out(name: str, levels: Sequence[str], codes: Integers, everybody: Integers) -> None:
    """A group of which nobody rated every cell is another matter than one that has no members."""
    gone = sorted(set(range(len(levels))) - set(codes.tolist()))
    if gone:
        n = int((everybody == gone[0]).sum())
        raise InputError(
            f"nobody in {name}={levels[gone[0]]} has a rating in every cell within participants, so all {n} "
            "were excluded; remove this group, or the level that they lack"
        )


def _refuse_two_values(
    name: str, other: NDArray[np.bool_], rows: pd.DataFrame, everybody: Sequence[str], person: Integers
) -> None:
    """A column of which some rows have another value than their participant's first row."""
    if other.any():
        at = int(np.argmax(other))
        before = int(np.argmax(person == person[at]))
        raise InputError(
            f"'{name}' differs within participant {everybody[person[at]]} ({rows[name].iloc[before]} and "
            f"{rows[name].iloc[at]}); a group or covariate has one value per participant; use --within for "
            "what changes within a participant"
        )
