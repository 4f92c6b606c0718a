"""Groups and covariates in a long table: columns that hold one value for each participant."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.within.between import BetweenDesign, Covariate, between_design, no_groups
from analysis.within.level_codes import level_codes
from experiments.errors import InputError

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
        One row a trial; `between` columns hold text, `covariates` finite numbers.
    participant : str
        Column of ids.
    people : sequence of str
        Who takes part in the tests.
    between, covariates : sequence of str
        Columns.
    centred : bool
        Whether covariates are centred at their mean over `people`.
    covariate_by_group : bool
        As in `between_design`.

    Raises
    ------
    InputError
        A participant with two values in a column, or as `between_design`.
    """
    if not between and not covariates:
        return no_groups(len(people))
    person, everybody = level_codes(rows[participant], participant)
    first = np.zeros(len(everybody), np.int64)
    first[person[::-1]] = np.arange(len(person))[::-1]
    position = {name: i for i, name in enumerate(everybody)}
    chosen = np.array([position[one] for one in people], np.int64)
    levels, codes = [], np.zeros((len(people), len(between)), np.int64)
    for k, name in enumerate(between):
        of_rows, own = level_codes(rows[name], name)
        _refuse_two_values(name, of_rows != of_rows[first][person], rows, everybody, person)
        levels.append(own)
        codes[:, k] = of_rows[first[chosen]]
        _refuse_left_out(name, own, codes[:, k], of_rows[first])
    numbers = []
    for name in covariates:
        measured = rows[name].to_numpy(dtype=np.float64)
        _refuse_two_values(name, measured != measured[first][person], rows, everybody, person)
        given = measured[first[chosen]]
        numbers.append(Covariate(name, given, float(given.mean()) if centred else 0.0, centred))
    return between_design(between, levels, codes, numbers, covariate_by_group)


def _refuse_left_out(name: str, levels: Sequence[str], codes: Integers, everybody: Integers) -> None:
    """A group of which nobody rated every cell is another matter than one that has no members."""
    gone = sorted(set(range(len(levels))) - set(codes.tolist()))
    if gone:
        n = int((everybody == gone[0]).sum())
        raise InputError(
            f"nobody in {name}={levels[gone[0]]} has a rating in every cell within participants, so that all "
            f"{n} were left out; leave out this group, or the level that they lack"
        )


def _refuse_two_values(
    name: str, other: NDArray[np.bool_], rows: pd.DataFrame, everybody: Sequence[str], person: Integers
) -> None:
    """A column of which some rows have another value than their participant's first row."""
    if other.any():
        at = int(np.argmax(other))
        before = int(np.argmax(person == person[at]))
        raise InputError(
            f"'{name}' differs within participant {everybody[person[at]]} "
            f"({rows[name].iloc[before]} and {rows[name].iloc[at]}); a group or covariate has "
            "one value for each participant, what changes within a participant belongs in --within"
        )
