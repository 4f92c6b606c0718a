"""The long table behind `analysis mixed` and `analysis ordinal`: anyone's, or the server's export."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.models.columns import columns_of, split_covariates
from analysis.read.number_columns import IN_COVARIATE, holds_numbers, numbers, unusual_numbers
from analysis.read.reading import (
    EXPORT_COLUMNS,
    refuse_mixed,
    report_visits,
    rows_that_count,
    rows_with_names,
)
from analysis.read.text_table import TextTable, read_text_table, texts_required
from experiments.errors import InputError
from experiments.kinds.clip_rating import RATINGS
from table_files import counted

EXPORTED_CLIPS = frozenset({"kind", "profile_id"})
"""Columns by which a table is an export of ratings of clips."""


@dataclass(frozen=True)
class ModelInput:
    """Rows with text columns and a numeric rating, which columns are what, and every decision taken."""

    rows: pd.DataFrame
    within: tuple[str, ...]
    item: tuple[str, ...]
    decisions: tuple[str, ...]
    synthetic: bool
    header: tuple[str, ...] = ()


def read_model_input(
    path: Path,
    participant: str,
    rating: str,
    within: Sequence[str],
    item: Sequence[str],
    between: Sequence[str] = (),
    covariates: Sequence[str] = (),
    random: Sequence[str] = (),
    *,
    no_predictors: bool = False,
) -> ModelInput:
    """Read one row per trial.

    Of an export (it has the column `kind`) only main trials count, without failed plays and runs excluded by
    hand; its factor columns are the default of `within`, its `profile_id` (the blink shown) that of `item`.
    Other tables may have no item. Rows without a covariate are left out, and counted.

    With `no_predictors` a model may have none, and an export has no defaults.

    Raises
    ------
    InputError
        Unknown columns, a column in two roles, items that are the participants under another name, ratings
        that are not numbers, or no factor.
    """
    # Only the header: defaults depend on it, and on them which columns are read.
    header = read_text_table(path, [participant, rating], copies=False).header
    exported = set(header) >= EXPORTED_CLIPS
    if not within and exported and not between and not no_predictors:
        within = RATINGS.factors_in_header(header)
    if not item and exported and not no_predictors:
        item = ["profile_id"]
    if not within and not between and not covariates and not no_predictors:
        raise InputError(
            "--within names no column; expected, for example, --within face,blur (a model of the mean alone: "
            f"--formula '{rating} ~ 1 + (1 | {participant})')"
        )
    covariates, _ = split_covariates(covariates, (*within, *between))
    _refuse_shared_roles(participant, rating, [*within, *between, *covariates], item)
    nested = list(dict.fromkeys(part for name in random for part in columns_of(name)))
    texts = list(dict.fromkeys((participant, *within, *between, *item, *nested)))
    table = read_text_table(path, list(dict.fromkeys([*texts, rating, *covariates])), EXPORT_COLUMNS)
    named = rows_with_names(table, EXPORTED_CLIPS)
    for name in texts:
        texts_required(table, name, factor=name in (*within, *between), rows=named)
    values = numbers(table, rating)
    unusual_numbers(table, rating, values)
    _refuse_participants_as_items(table, participant, item)
    measured = {name: numbers(table, name) for name in covariates}
    for name, given in measured.items():
        unusual_numbers(table, name, given, IN_COVARIATE)
    rows = table.columns.assign(**{rating: values}, **measured)
    keep = ~np.isnan(values)
    left_out: list[str] = []
    if exported:
        keep, left_out = rows_that_count(rows, keep, path.name)
        refuse_mixed(table, keep, [*texts, *covariates])
        report_visits(table, keep)
    decisions = [*table.decisions, *left_out]
    if np.isnan(values).any():
        decisions.append(f"{counted(int(np.isnan(values).sum()), 'row')} without a rating excluded")
    # Counted among the rows that are left, so that no row is named twice.
    for name, column in measured.items():
        if (without := np.isnan(column) & keep).any():
            decisions.append(f"{counted(int(without.sum()), 'row')} without {name} excluded")
            keep = keep & ~without
    if not keep.any():
        raise InputError(f"{path.name}: no row has a usable rating")
    return ModelInput(
        rows[keep].reset_index(drop=True),
        tuple(within),
        tuple(item),
        tuple(decisions),
        table.synthetic,
        table.header,
    )


def _refuse_shared_roles(participant: str, rating: str, within: Sequence[str], item: Sequence[str]) -> None:
    if list(item) == [participant]:
        raise InputError(
            f"'{participant}' is named as participant and as item; name the column of clips, or omit --item"
        )
    names = [participant, rating, *within]
    for name in names:
        # The rating cannot also be an item; a factor can, where each level is one clip.
        if names.count(name) > 1 or (name in item and name == rating):
            raise InputError(f"column '{name}' is named for two roles; each role needs a separate column")


def _refuse_participants_as_items(table: TextTable, participant: str, item: Sequence[str]) -> None:
    """Items that each belong to one participant, one each, are the participants themselves."""
    if not item:
        return
    # An item may be named by the participant's column and another one.
    pairs = table.columns[list(dict.fromkeys([participant, *item]))].drop_duplicates()
    # A separator that no cell contains: a-b and c must differ from a and b-c.
    what = pairs[list(item)].astype(str).agg("\x1f".join, axis=1)
    people = pairs[participant].astype(str)
    # As many pairs as people and as items: each belongs to exactly one.
    if len(pairs) > 1 and len(pairs) == people.nunique() == what.nunique():
        raise InputError(
            f"every item of '{'/'.join(item)}' belongs to one participant and every participant has one, so "
            "items and participants are the same. Name the column of clips, or omit --item"
        )


def header_and_numbers(path: Path) -> tuple[tuple[str, ...], frozenset[str]]:
    """The columns of a table, and those that hold numbers alone (and missing marks)."""
    table = read_text_table(path, None, copies=False)
    of_numbers = (name for name in table.header if holds_numbers(table.columns[name].cat.categories))
    return table.header, frozenset(of_numbers)
