"""A model as R writes it: `rating ~ a*b*age + (1 + a | person) + (1 | clip)`."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

from analysis.models.columns import Slopes
from experiments.errors import InputError, did_you_mean

EXAMPLE = "rating ~ a*b*age + (1 + a | person) + (1 | clip)"
_RANDOM = re.compile(r"\(([^()|]*)(\|\|?)([^()|]*)\)")
_FACTOR = re.compile(r"\b(?:factor|C)\(\s*([^()]+?)\s*\)")
_NAME = re.compile(r"(?:[^\W\d]|\.)[\w.]*")

Effect = tuple[str, ...]
"""Names of the columns of an effect."""


@dataclass(frozen=True)
class RandomPart:
    """A grouping (`a` or `a/b`), its slopes in addition to the intercept, and whether they correlate."""

    slopes: tuple[Effect, ...]
    correlated: bool
    grouping: str


@dataclass(frozen=True)
class Formula:
    """A parsed formula; `as_factors` are the columns written as factor(x)."""

    text: str
    rating: str
    effects: tuple[Effect, ...]
    random: tuple[RandomPart, ...]
    as_factors: frozenset[str]

    @property
    def predictors(self) -> tuple[str, ...]:
        """Columns of the fixed part, in order."""
        return tuple(dict.fromkeys(name for effect in self.effects for name in effect))

    @property
    def columns(self) -> tuple[str, ...]:
        """Every column that is named."""
        groupings = [name for part in self.random for name in part.grouping.split("/")]
        return tuple(dict.fromkeys((self.rating, *self.predictors, *groupings)))


@dataclass(frozen=True)
class ModelOptions:
    """A formula in the words of the commands' options; `group_slopes` are those of further groupings."""

    participant: str
    rating: str
    factors: tuple[str, ...]
    covariates: tuple[str, ...]
    item: tuple[str, ...]
    random: tuple[str, ...]
    slopes: Slopes
    effects: tuple[str, ...]
    slope_effects: tuple[str, ...]
    group_slopes: tuple[tuple[str, tuple[str, ...]], ...] = ()


def parse_formula(text: str) -> Formula:
    """Read a formula.

    Raises
    ------
    InputError
        What is not written as names, +, *, :, and (effects | grouping); a model without an intercept or a
        grouping; an interaction without its parts.
    """
    rating, tilde, right = text.partition("~")
    if not tilde or not _NAME.fullmatch(rating.strip()):
        raise InputError(f"expected a formula such as {EXAMPLE}, got '{text}'")
    as_factors = frozenset(_FACTOR.findall(right))
    right = _FACTOR.sub(r"\1", right)
    random = tuple(
        RandomPart(_effects_of(effects, text), bar == "|", _grouping_of(grouping, text))
        for effects, bar, grouping in _RANDOM.findall(right)
    )
    # A bracket becomes the intercept, so that the pluses around it stay a valid sum.
    fixed = _effects_of(_RANDOM.sub("1", right), text)
    if not random:
        raise InputError(f"'{text}' has no random term; add one, such as (1 | participant)")
    known = {frozenset(effect) for effect in fixed}
    for effect in fixed:
        for part in (p for size in range(1, len(effect)) for p in combinations(effect, size)):
            if frozenset(part) not in known:
                raise InputError(
                    f"'{text}' has {':'.join(effect)} without {':'.join(part)}; add it, or write "
                    f"{'*'.join(effect)}"
                )
    for bracket in random:
        for effect in bracket.slopes:
            if frozenset(effect) not in known:
                raise InputError(
                    f"the slope of {':'.join(effect)} needs {':'.join(effect)} outside the brackets too"
                )
    return Formula(text, rating.strip(), fixed, random, as_factors)


def model_options(formula: Formula, header: Sequence[str], numeric: Collection[str]) -> ModelOptions:
    """What the formula means for a table: columns of numbers are covariates, others factors.

    Raises
    ------
    InputError
        A name that is not a column; slopes of more than one grouping.
    """
    for name in formula.columns:
        if name not in header:
            raise InputError(f"'{name}' in the formula is not a column{did_you_mean(name, header)}")
    with_slopes = [part for part in formula.random if part.slopes]
    correlated = [part for part in with_slopes if part.correlated]
    if len(correlated) > 1:
        raise InputError(
            f"slopes of one grouping may correlate; write (1 + {':'.join(correlated[1].slopes[0])} || "
            f"{correlated[1].grouping}) for the other"
        )
    for part in with_slopes:
        if "/" in part.grouping:
            raise InputError(
                f"the nested grouping {part.grouping} has no slopes; write (1 | {part.grouping})"
            )
    # The grouping whose slopes correlate, else one with slopes, else the first takes the participants' part.
    people = (correlated or with_slopes or list(formula.random))[0]
    if "/" in people.grouping:
        raise InputError(f"name another grouping before the nested {people.grouping}")
    others = [part.grouping for part in formula.random if part is not people]
    factors = tuple(n for n in formula.predictors if n in formula.as_factors or n not in numeric)
    named = [":".join(effect) for effect in formula.effects if not set(effect) <= set(factors)]
    slopes: Slopes = "none" if not people.slopes else "correlated" if people.correlated else "all"
    first_item = next((name for name in others if "/" not in name), None)
    return ModelOptions(
        people.grouping,
        formula.rating,
        factors,
        tuple(named),
        () if first_item is None else (first_item,),
        tuple(name for name in others if name != first_item),
        slopes,
        tuple(":".join(effect) for effect in formula.effects if set(effect) <= set(factors)),
        tuple(":".join(effect) for effect in people.slopes),
        tuple(
            (part.grouping, tuple(":".join(effect) for effect in part.slopes))
            for part in with_slopes
            if part is not people
        ),
    )


def _effects_of(text: str, whole: str) -> tuple[Effect, ...]:
    """Effects of `a*b + c` without the intercept, which every term has; a*b is a + b + a:b."""
    effects: dict[frozenset[str], Effect] = {}
    without_intercept = False
    for term in (part.strip() for part in text.split("+")):
        without_intercept |= term == "0"
        factors = [] if term in ("0", "1") else [part.strip() for part in re.split(r"[*:]", term)]
        if not all(_NAME.fullmatch(name) for name in factors) or ("*" in term and ":" in term):
            raise InputError(
                f"'{term}' in '{whole}' is not understood; expected names joined by +, * or :, as in "
                f"{EXAMPLE}"
            )
        factors = list(dict.fromkeys(factors))  # a:a is a
        sizes = range(1, len(factors) + 1) if "*" in term else [len(factors)]
        for effect in chain.from_iterable(combinations(factors, size) for size in sizes):
            effects.setdefault(frozenset(effect), effect)
    if without_intercept:
        raise InputError(f"'{whole}' has a term without an intercept (0 +), which is not supported")
    return tuple(sorted((effect for effect in effects.values() if effect), key=len))


def _grouping_of(text: str, whole: str) -> str:
    parts = [part.strip() for part in text.split("/")]
    if not all(_NAME.fullmatch(part) for part in parts):
        raise InputError(f"'{text.strip()}' in '{whole}' is not a grouping; expected person, or lab/room")
    return "/".join(parts)
