"""Groups and covariates in a long table: columns that hold one value for each participant."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.within.between import BetweenDesign, Covariate, between_design
from analysis.within.cell_means import factorized, natural_order
from experiments.errors import InputError


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
    levels, codes = [], np.zeros((len(people), len(between)), np.int64)
    for k, name in enumerate(between):
        value = one_value_each(rows, participant, name)
        levels.append(natural_order(sorted({str(text) for text in value.values()})))
        codes[:, k] = [levels[k].index(str(value[person])) for person in people]
        _refuse_left_out(name, levels[k], codes[:, k], [str(one) for one in value.values()])
    numbers = []
    for name in covariates:
        measured = one_value_each(rows, participant, name)
        given: NDArray[np.float64] = np.array([measured[person] for person in people], dtype=np.float64)
        numbers.append(Covariate(name, given, float(given.mean()) if centred else 0.0, centred))
    return between_design(between, levels, codes, numbers, covariate_by_group)


def _refuse_left_out(
    name: str, levels: Sequence[str], codes: NDArray[np.int64], everybody: Sequence[str]
) -> None:
    """A group of which nobody rated every cell is another matter than one that has no members."""
    gone = sorted(set(range(len(levels))) - set(codes.tolist()))
    if gone:
        level = levels[gone[0]]
        raise InputError(
            f"nobody in {name}={level} has a rating in every cell within participants, so that all "
            f"{everybody.count(level)} were left out; leave out this group, or the level that they lack"
        )


def one_value_each(rows: pd.DataFrame, participant: str, name: str) -> dict[str, object]:
    """Each participant's value of a column; refused where a participant has two."""
    person, people = factorized(rows[participant])
    value, values = factorized(rows[name])
    first = np.zeros(len(people), np.int64)
    first[person[::-1]] = value[::-1]
    twice = value != first[person]
    if twice.any():
        at = int(np.argmax(twice))
        two = f"{values[first[person[at]]]} and {values[value[at]]}"
        raise InputError(
            f"'{name}' differs within participant {people[person[at]]} ({two}); a group or covariate has "
            "one value for each participant, what changes within a participant belongs in --within"
        )
    return {str(one): values[at] for one, at in zip(people, first.tolist(), strict=True)}
