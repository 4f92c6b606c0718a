"""Long rows as what the mixed and ordinal models need: codes, sum-coded cells, covariates, groupings."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.models.coding import coded_cells
from analysis.models.columns import Grouping, covariate_columns, groupings, ratings, refuse_unknown_columns
from analysis.models.roles import ModelTerms, RandomSlopes, Slopes
from analysis.models.terms import Term, intercept_term
from analysis.within.level_codes import level_codes
from experiments.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class ModelData:
    """Trials in coded form.

    Attributes
    ----------
    factors : tuple of str
        Those between participants first.
    cell : int64 array (n,)
        Codes of the cells.
    rating : float64 array (n,)
        Responses.
    fixed : float64 array (cells, cells)
        Sum-coded full factorial of `factors`.
    spread : float64 array (cells, cells)
        The same effects as orthonormal contrasts scaled to unit variance.
    effect_of : tuple of str
        The effect of each column, `intercept` first.
    numbers : float64 array (n, k)
        Centred covariates.
    groups : tuple of Grouping
        Participants, items (if any), further groupings.
    """

    terms: ModelTerms
    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    groups: tuple[Grouping, ...]
    cell: Integers = field(repr=False)
    rating: Floats = field(repr=False)
    fixed: Floats = field(repr=False)
    spread: Floats = field(repr=False)
    numbers: Floats = field(repr=False)
    effect_of: tuple[str, ...]
    column_names: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def effects(self) -> list[str]:
        """Effects in order, main effects first, covariates last, without the intercept."""
        factorial = dict.fromkeys(name for name in self.effect_of if name != "intercept")
        return [*factorial, *self.terms.covariates]

    @property
    def slope_effects(self) -> list[str]:
        """Effects in which participants can differ: of factors within participants alone."""
        inside = set(self.terms.within)
        return [effect for effect in self.effects if inside.issuperset(effect.split(":"))]

    @property
    def participants(self) -> Grouping:
        """Who rated."""
        return self.groups[0]

    @property
    def items(self) -> Grouping | None:
        """What was rated."""
        return self.groups[1] if self.terms.item else None

    @property
    def fixed_part(self) -> str:
        """The right-hand side of the formula, without random terms."""
        factorial = [" * ".join(self.factors)] if self.factors else []
        return " + ".join([*factorial, *self.terms.covariates]) or "1"

    @property
    def x(self) -> Floats:
        """Fixed effects (n, cells + covariates)."""
        return np.hstack([self.fixed[self.cell], self.numbers])

    def columns(self, effect: str) -> Integers:
        """Positions of an effect's columns in `x`."""
        if effect in self.terms.covariates:
            return np.array([len(self.effect_of) + self.terms.covariates.index(effect)])
        return np.flatnonzero(np.array(self.effect_of) == effect)

    def differences(self, effect: str) -> Floats:
        """Contrasts (q, columns of x) of an effect as differences from the first level of each factor.

        The df of a test of several contrasts depend a little on how these are written; lmerTest's are these.
        """
        width = len(self.effect_of) + len(self.terms.covariates)
        if effect in self.terms.covariates:
            return np.eye(width)[self.columns(effect)]
        members = effect.split(":")
        rows: Floats = np.ones((1, 1))
        for factor, names in zip(self.factors, self.levels, strict=True):
            size = len(names)
            from_first = np.hstack([-np.ones((size - 1, 1)), np.eye(size - 1)])
            rows = np.asarray(
                np.kron(rows, from_first if factor in members else np.full((1, size), 1 / size))
            )
        contrasts = rows @ self.fixed
        return np.hstack([contrasts, np.zeros((len(contrasts), width - contrasts.shape[1]))])

    def random_effects(self, slopes: RandomSlopes) -> list[str]:
        """What differs between levels of a further grouping, `intercept` first; covariates do not."""
        every = list(dict.fromkeys(self.effect_of))
        return [name for name in every if slopes == "all" or name == "intercept" or name in self.factors]

    def has_slopes(self, group: Grouping) -> bool:
        """Whether a grouping may have slopes: the outer ones of `terms.random`."""
        return group.name in {name.split("/")[0] for name in self.terms.random}

    def random_terms(
        self, slopes: Slopes, effects: Sequence[str], random_slopes: RandomSlopes = "none"
    ) -> list[Term]:
        """Participants with slopes of `effects` (`intercept` first), then every other group."""
        of_column = [effect for effect in effects for _ in self.columns(effect)]
        columns = np.concatenate([self.columns(effect) for effect in effects])
        p = len(columns)
        if slopes == "correlated":
            rows, others = np.tril_indices(p)
            patterns = np.zeros((len(rows), p, p))
            patterns[np.arange(len(rows)), rows, others] = 1.0
        else:
            patterns = np.stack([np.diag([float(e == name) for name in of_column]) for e in effects])
        people = self.participants
        terms = [Term(people.codes, len(people.names), self.spread[:, columns][self.cell], patterns)]
        return terms + [self._further_term(group, random_slopes) for group in self.groups[1:]]

    def _further_term(self, group: Grouping, slopes: RandomSlopes) -> Term:
        """Independent slopes, one variance an effect, as participants have them; or an intercept."""
        if slopes == "none" or not self.has_slopes(group):
            return intercept_term(group.codes, len(group.names))
        effects = self.random_effects(slopes)
        of_column = [name for name in self.effect_of if name in effects]
        z = self.spread[:, np.isin(self.effect_of, effects)][self.cell]
        patterns = np.stack([np.diag([float(name == e) for name in of_column]) for e in effects])
        return Term(group.codes, len(group.names), z, patterns)


def model_data(rows: pd.DataFrame, terms: ModelTerms) -> ModelData:
    """Code long rows, one a trial.

    A factor of `within` with one level for each participant is taken as one between them, and said.

    Raises
    ------
    InputError
        Unknown columns, missing values, fewer than two participants, items or levels, a factor of `between`
        that varies within a participant, cells that nobody rated, covariates that the factors determine,
        groupings that are one and the same.
    """
    refuse_unknown_columns(rows, terms)
    values = ratings(rows, terms.rating)
    groups = groupings(rows, terms)
    terms, said = _by_participant(rows, terms, groups[0].codes)
    factors = (*terms.between, *terms.within)
    coded = [_coded(rows[name], name) for name in factors]
    levels = tuple(names for _, names in coded)
    shape = tuple(len(names) for names in levels)
    cell = np.zeros(len(values), np.int64)
    if factors:
        cell = np.ravel_multi_index(tuple(codes for codes, _ in coded), shape).astype(np.int64)
    _refuse_empty_cells(cell, factors, levels)
    fixed, spread, effect_of, names = coded_cells(list(factors), levels)
    numbers, centred = covariate_columns(rows, terms, groups[0].codes)
    data = ModelData(
        terms,
        factors,
        levels,
        groups,
        cell,
        values,
        fixed,
        spread,
        numbers,
        effect_of,
        (*names, *terms.covariates),
        (*said, *centred),
    )
    _refuse_collinear(data)
    return data


def _by_participant(
    rows: pd.DataFrame, terms: ModelTerms, codes: Integers
) -> tuple[ModelTerms, tuple[str, ...]]:
    """Factors where they belong: with one level for each participant they are between participants."""
    constant = []
    for name in (*terms.within, *terms.between):
        per_person = rows[name].astype(str).groupby(codes).nunique().to_numpy()
        if name in terms.between and (per_person > 1).any():
            at = np.flatnonzero(codes == int(np.argmax(per_person > 1)))
            two = pd.unique(rows[name].astype(str).iloc[at])[:2]
            raise InputError(
                f"'{name}' differs within participant {rows[terms.participant].iloc[at[0]]} ({two[0]} and "
                f"{two[1]}); what changes within a participant belongs in --within"
            )
        if name in terms.within and (per_person == 1).all() and rows[name].nunique() > 1:
            constant.append(name)
    if not constant:
        return terms, ()
    within = tuple(name for name in terms.within if name not in constant)
    moved = replace(terms, within=within, between=(*terms.between, *constant))
    said = f"{', '.join(constant)}: one level for each participant, taken as between participants"
    return moved, (said,)


def _coded(column: "pd.Series[str]", name: str) -> tuple[Integers, tuple[str, ...]]:
    codes, names = level_codes(column, name)
    if len(names) < 2:
        raise InputError(f"expected at least two levels of '{name}', got {len(names)}")
    return codes, tuple(names)


def _refuse_empty_cells(cell: Integers, factors: Sequence[str], levels: Sequence[Sequence[str]]) -> None:
    counts = np.bincount(cell, minlength=int(np.prod([len(names) for names in levels])))
    if (counts == 0).any():
        names = list(product(*levels))[int(np.flatnonzero(counts == 0)[0])]
        where = ", ".join(f"{factor}={level}" for factor, level in zip(factors, names, strict=True))
        raise InputError(f"nobody rated the cell {where}; leave out a factor or level")


def _refuse_collinear(data: ModelData) -> None:
    if not data.terms.covariates:
        return
    x = data.x
    scaled = x / np.linalg.norm(x, axis=0)
    if np.linalg.matrix_rank(scaled.T @ scaled, tol=1e-10) < x.shape[1]:
        raise InputError(
            f"the covariates {', '.join(data.terms.covariates)} are determined by the factors or by one "
            "another; leave one out"
        )
