"""Long rows as what the mixed and ordinal models need: codes, sum-coded cells, covariates, groupings."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.models.columns import (
    Grouping,
    ModelTerms,
    RandomSlopes,
    Slopes,
    covariate_columns,
    groupings,
    ratings,
    refuse_unknown_columns,
)
from analysis.models.formula import formula_name
from analysis.models.reml import Term, intercept_term
from analysis.read.number_columns import holds_numbers
from analysis.within.level_codes import level_codes
from analysis.within.strata import effect_members, effect_name, orthonormal_basis
from experiments.errors import InputError

# Cells of a factorial design as sum-coded effects, and as orthonormal contrasts of unit variance.

Floats = NDArray[np.float64]


def _sum_coding(levels: int) -> Floats:
    """Contrasts of R's contr.sum with a column of ones before them, (levels, levels)."""
    # The last level is minus the sum of the others, so that columns sum to 0.
    coding = np.eye(levels)[:, :-1]
    coding[-1] = -1.0
    return np.hstack([np.ones((levels, 1)), coding])


def coded_cells(
    factors: list[str], levels: Sequence[Sequence[str]]
) -> tuple[Floats, Floats, tuple[str, ...], tuple[str, ...]]:
    """Both codings (cells, cells), the effect of each column, and the columns' names.

    Parameters
    ----------
    factors : list of str
        Names.
    levels : sequence of sequence of str
        Their levels; cells vary fastest in the last factor.
    """
    sizes = [len(names) for names in levels]
    fixed, spread = [np.ones((int(np.prod(sizes)), 1))], [np.ones((int(np.prod(sizes)), 1))]
    effect_of, names = ["intercept"], ["intercept"]
    for members in effect_members(len(factors)):
        codings: Floats = np.ones((1, 1))
        bases: Floats = np.ones((1, 1))
        for axis, size in enumerate(sizes):
            inside = axis in members
            codings = np.asarray(np.kron(codings, _sum_coding(size)[:, 1:] if inside else np.ones((size, 1))))
            # Columns of unit variance, so that SDs of slopes of different factors can be compared.
            basis = orthonormal_basis(size) * np.sqrt(size)
            bases = np.asarray(np.kron(bases, basis[:, 1:] if inside else np.ones((size, 1))))
        fixed.append(codings)
        spread.append(bases)
        effect = effect_name([factors[m] for m in members])
        effect_of += [effect] * codings.shape[1]
        # Sum coding has a column for every level but the last, which is minus the sum of the others.
        inner = product(*[levels[m][:-1] for m in members])
        names += [
            ":".join(f"{factors[m]}[{lv}]" for m, lv in zip(members, row, strict=True)) for row in inner
        ]
    return np.hstack(fixed), np.hstack(spread), tuple(effect_of), tuple(names)


Integers = NDArray[np.int64]


@dataclass(frozen=True)
class NumberEffect:
    """A covariate, or its interaction with other covariates and factors.

    Attributes
    ----------
    name : str
        Its members, separated by colons.
    covariates, factors : tuple of str
        The members; factors in the order of the design.
    differs : bool
        Participants can differ in it: every member varies within participants.
    """

    name: str
    covariates: tuple[str, ...]
    factors: tuple[str, ...]
    differs: bool


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
        Centered covariates.
    number_effects : tuple of NumberEffect
        Covariates in the order of `numbers`, then their interactions.
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
    number_effects: tuple[NumberEffect, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def effects(self) -> list[str]:
        """Effects in order, main effects first, covariates last, without the intercept."""
        return [*self.factorial_effects, *(effect.name for effect in self.number_effects)]

    @property
    def factorial_effects(self) -> list[str]:
        """Effects of factors alone, main effects first."""
        return list(dict.fromkeys(name for name in self.effect_of if name != "intercept"))

    @property
    def slope_effects(self) -> list[str]:
        """Effects in which participants can differ: of what varies within them; covariates first."""
        inside = set(self.terms.within)
        of_factors = [name for name in self.factorial_effects if inside.issuperset(name.split(":"))]
        mixed = [effect.name for effect in self.number_effects if effect.differs and effect.factors]
        products = [
            effect.name
            for effect in self.number_effects
            if effect.differs and not effect.factors and len(effect.covariates) > 1
        ]
        return [*self.covariate_slopes, *of_factors, *products, *mixed]

    @property
    def covariate_slopes(self) -> list[str]:
        """Covariates that vary within participants."""
        return [e.name for e in self.number_effects if e.differs and len(e.covariates) == 1 and not e.factors]

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
        factorial = list(map(self.in_formula, self.factorial_effects))
        # a + b + a:b is written a * b.
        if factorial and len(factorial) == 2 ** len(self.factors) - 1:
            factorial = [" * ".join(map(self.in_formula, self.factors))]
        numbers = [self.in_formula(effect.name) for effect in self.number_effects]
        return " + ".join([*factorial, *numbers]) or "1"

    def in_formula(self, effect: str) -> str:
        """An effect as `--formula` and R read it: factor(blur) where the levels are numbers."""
        if effect == "intercept":
            return "1"
        levels = dict(zip(self.factors, self.levels, strict=True))
        return ":".join(
            f"factor({formula_name(name)})" if holds_numbers(levels.get(name, ())) else formula_name(name)
            for name in effect.split(":")
        )

    @property
    def x(self) -> Floats:
        """Fixed effects (n, cells + columns of covariates)."""
        products = [self._product(effect, self.fixed) for effect in self.number_effects]
        return np.hstack([self.fixed[self.cell], *products])

    def columns(self, effect: str) -> Integers:
        """Positions of an effect's columns in `x`."""
        return np.flatnonzero(np.array(self._effect_of_x) == effect)

    @property
    def _effect_of_x(self) -> list[str]:
        of_numbers = [e.name for e in self.number_effects for _ in range(self._of_factors(e).size)]
        return [*self.effect_of, *of_numbers]

    def _of_factors(self, effect: NumberEffect) -> Integers:
        """Columns of the factorial that an interaction of covariates multiplies; the intercept's of none."""
        name = ":".join(effect.factors) or "intercept"
        return np.flatnonzero(np.array(self.effect_of) == name)

    def _product(self, effect: NumberEffect, coding: Floats) -> Floats:
        """Columns (n, q) of covariates, multiplied with those of factors in one of the two codings."""
        at = [self.terms.covariates.index(name) for name in effect.covariates]
        number = self.numbers[:, at].prod(axis=1)
        return np.asarray(number[:, None] * coding[:, self._of_factors(effect)][self.cell])

    def unit(self, effect: str) -> float:
        """Standard deviation of a covariate's column of `slope_columns`, in the covariate's own unit."""
        number_effect = next((one for one in self.number_effects if one.name == effect), None)
        if number_effect is None:
            return 1.0
        return float(np.sqrt((self._product(number_effect, self.spread) ** 2).mean()))

    def slope_columns(self, effects: Sequence[str]) -> Floats:
        """Columns (n, p) whose coefficients differ between levels of a grouping, in units of `unit`."""
        named = {effect.name: effect for effect in self.number_effects}
        parts = [
            self._product(named[effect], self.spread) / self.unit(effect)
            if effect in named
            else self.spread[:, np.array(self.effect_of) == effect][self.cell]
            for effect in effects
        ]
        return np.hstack(parts)

    def differences(self, effect: str) -> Floats:
        """Contrasts (q, columns of x) of an effect as differences from the first level of each factor.

        The df of a test of several contrasts depend a little on how these are written; lmerTest's are these.
        """
        number_effect = next((one for one in self.number_effects if one.name == effect), None)
        members = effect.split(":") if number_effect is None else list(number_effect.factors)
        width = len(self._effect_of_x)
        if number_effect is not None and not members:
            return np.eye(width)[self.columns(effect)]
        rows: Floats = np.ones((1, 1))
        for factor, names in zip(self.factors, self.levels, strict=True):
            size = len(names)
            from_first = np.hstack([-np.ones((size - 1, 1)), np.eye(size - 1)])
            # Factors outside the effect are averaged with equal weights, however many ratings each level has.
            rows = np.asarray(
                np.kron(rows, from_first if factor in members else np.full((1, size), 1 / size))
            )
        contrasts = rows @ self.fixed
        whole = np.zeros((len(contrasts), width))
        if number_effect is None:
            whole[:, : contrasts.shape[1]] = contrasts
        else:
            whole[:, self.columns(effect)] = contrasts[:, self._of_factors(number_effect)]
        return whole

    def group_effects(self, group: Grouping, slopes: RandomSlopes) -> list[str]:
        """What differs between levels of a further grouping, `intercept` first.

        Covariates do only where a formula names them.
        """
        named = dict(self.terms.group_slopes).get(group.name)
        if named is not None:
            known = {frozenset(name.split(":")): name for name in self.effects}
            return ["intercept", *(known[frozenset(name.split(":"))] for name in named)]
        if slopes == "none" or not self.has_slopes(group):
            return ["intercept"]
        every = list(dict.fromkeys(self.effect_of))
        return [name for name in every if slopes == "all" or name == "intercept" or name in self.factors]

    def has_slopes(self, group: Grouping) -> bool:
        """Whether a grouping may have slopes: the outer ones of `terms.random`."""
        return group.name in {name.split("/")[0] for name in self.terms.random}

    def random_terms(
        self, slopes: Slopes, effects: Sequence[str], random_slopes: RandomSlopes = "none"
    ) -> list[Term]:
        """Participants with slopes of `effects` (`intercept` first), then every other group.

        A covariate's slope is correlated with the intercept, and with other covariates': where zero lies on
        the covariate's scale must not matter. Slopes of contrasts do not correlate, unless asked for.
        """
        of_column = [effect for effect in effects for _ in self.columns(effect)]
        p = len(of_column)
        if slopes == "correlated":
            # One theta per entry of a lower triangle L: the covariance L L' cannot become indefinite.
            rows, others = np.tril_indices(p)
            patterns = np.zeros((len(rows), p, p))
            patterns[np.arange(len(rows)), rows, others] = 1.0
        else:
            # One theta per effect: its columns share it, so that the fit does not depend on their coding.
            patterns = np.stack([np.diag([float(e == name) for name in of_column]) for e in effects])
            shared = [of_column.index(name) for name in self.correlated_effects(effects)]
            pairs = [(row, column) for i, row in enumerate(shared) for column in shared[:i]]
            crossed = np.zeros((len(pairs), p, p))
            for k, (row, column) in enumerate(pairs):
                crossed[k, row, column] = 1.0
            patterns = np.concatenate([patterns, crossed])
        people = self.participants
        terms = [Term(people.codes, len(people.names), self.slope_columns(effects), patterns)]
        return terms + [self._further_term(group, random_slopes) for group in self.groups[1:]]

    def correlated_effects(self, effects: Sequence[str]) -> list[str]:
        """The intercept and covariates among participants' terms, which correlate; nothing without these."""
        may = self.terms.correlated_slopes
        sloped = [name for name in effects if name in (self.covariate_slopes if may is None else may)]
        return ["intercept", *sloped] if sloped else []

    def _further_term(self, group: Grouping, slopes: RandomSlopes) -> Term:
        """Independent slopes, one variance per effect, as participants have them; or an intercept."""
        effects = self.group_effects(group, slopes)
        if effects == ["intercept"]:
            return intercept_term(group.codes, len(group.names))
        of_column = [name for name in effects for _ in self.columns(name)]
        z = self.slope_columns(effects)
        patterns = np.stack([np.diag([float(name == e) for name in of_column]) for e in effects])
        return Term(group.codes, len(group.names), z, patterns)


def model_data(rows: pd.DataFrame, terms: ModelTerms) -> ModelData:
    """Code long rows, one per trial.

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
    factors: tuple[str, ...] = (*terms.between, *terms.within)
    coded = [_coded(rows[name], name) for name in factors]
    levels = tuple(names for _, names in coded)
    shape = tuple(len(names) for names in levels)
    cell = np.zeros(len(values), np.int64)
    if factors:
        # The last factor varies fastest, as the rows of both codings do.
        cell = np.ravel_multi_index(tuple(codes for codes, _ in coded), shape).astype(np.int64)
    if terms.effects is None:
        _refuse_empty_cells(cell, factors, levels)
    fixed, spread, effect_of, names = coded_cells(list(factors), levels)
    if terms.effects is not None:
        # As sets, since a:b and b:a are one effect; the empty set is the intercept.
        known = {frozenset(), *(frozenset(name.split(":")) for name in terms.effects)}
        has = [frozenset(name.split(":")) - {"intercept"} in known for name in effect_of]
        fixed, spread = fixed[:, has], spread[:, has]
        effect_of, names = (
            tuple(one for one, k in zip(of, has, strict=True) if k) for of in (effect_of, names)
        )
    numbers, centred = covariate_columns(rows, terms, groups[0].codes)
    effects = _number_effects(terms, factors, numbers, groups[0].codes)
    sizes = {factor: of[:-1] for factor, of in zip(factors, levels, strict=True)}
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
        (*names, *(name for effect in effects for name in _column_names(effect, sizes))),
        effects,
        (*said, *centred),
    )
    _refuse_collinear(data)
    return data


def _number_effects(
    terms: ModelTerms, factors: Sequence[str], numbers: Floats, people: Integers
) -> tuple[NumberEffect, ...]:
    """Covariates, then their interactions; which of them vary within participants."""
    each = pd.DataFrame(numbers, columns=list(terms.covariates)).groupby(people).nunique()
    # In more than one participant: a slope that a single one determines has no variance.
    inside = {name for name in terms.covariates if int((each[name] > 1).sum()) > 1} | set(terms.within)
    effects = []
    for members in (*((name,) for name in terms.covariates), *terms.interactions):
        of_factors = tuple(name for name in factors if name in members)
        of_numbers = tuple(name for name in members if name not in of_factors)
        name = ":".join((*of_factors, *of_numbers)) if len(members) > 1 else members[0]
        differs = inside.issuperset(members)
        effects.append(NumberEffect(name, of_numbers, of_factors, differs))
    names = [effect.name for effect in effects]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"the interaction {name} is named twice; remove one")
    return tuple(effects)


def _column_names(effect: NumberEffect, levels: dict[str, tuple[str, ...]]) -> list[str]:
    rows = product(*(levels[factor] for factor in effect.factors))
    return [
        ":".join((*(f"{f}[{lv}]" for f, lv in zip(effect.factors, row, strict=True)), *effect.covariates))
        for row in rows
    ]


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
                f"{two[1]}); use --within for what changes within a participant"
            )
        if name in terms.within and (per_person == 1).all() and rows[name].nunique() > 1:
            constant.append(name)
    if not constant:
        return terms, ()
    within = tuple(name for name in terms.within if name not in constant)
    moved = replace(terms, within=within, between=(*terms.between, *constant))
    said = f"{', '.join(constant)}: one level per participant, treated as a factor between participants"
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
        raise InputError(f"nobody rated the cell {where}; remove a factor or level")


def _refuse_collinear(data: ModelData) -> None:
    if not data.terms.covariates and data.terms.effects is None:
        return
    x = data.x
    # At unit length: a covariate in small units would look like a combination of the others.
    scaled = x / np.linalg.norm(x, axis=0)
    # Rank of the products (f, f), not of x (n, f): singular values are squared, hence the small tolerance.
    if np.linalg.matrix_rank(scaled.T @ scaled, tol=1e-10) < x.shape[1]:
        # A cell that nobody rated makes effects dependent as well, and is the plainer reason to name.
        if data.terms.effects is not None:
            _refuse_empty_cells(data.cell, data.factors, data.levels)
        raise InputError(
            f"the covariates {', '.join(data.terms.covariates)} are determined by the factors or by one "
            "another; remove one"
        )
