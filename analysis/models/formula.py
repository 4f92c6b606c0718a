"""A model as R writes it: `rating ~ a*b*age + (1 + a | person) + (1 | clip)`."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

from analysis.models.columns import Slopes, columns_of
from experiments.errors import InputError, did_you_mean

EXAMPLE = "rating ~ a*b*age + (1 + a | person) + (1 | clip)"
_RANDOM = re.compile(r"\(([^()|]*)(\|\|?)([^()|]*)\)")
_FACTOR = re.compile(r"\b(?:factor|C)\(\s*([^()]+?)\s*\)")
_NAME = re.compile(r"(?:[^\W\d]|\.)[\w.]*")
_QUOTED = re.compile(r"`([^`]+)`")

SLOPES_NOTE = (
    "Slopes: orthogonal contrasts of unit variance; the contrasts of one effect share one variance, "
    "uncorrelated. The formula writes this as ||, which in lmer means the same only for columns of numbers."
)

Effect = tuple[str, ...]
"""Names of the columns of an effect."""


@dataclass(frozen=True)
class RandomPart:
    """A grouping (`a`, `a/b` or `a:b`) and its slopes in addition to the intercept.

    `correlated` slopes correlate with the intercept and one another, those of `independent` do not; `alone`
    are the ones of these that were written as (0 + x | grouping).
    """

    grouping: str
    correlated: tuple[Effect, ...]
    independent: tuple[Effect, ...]
    alone: tuple[Effect, ...]

    @property
    def slopes(self) -> tuple[Effect, ...]:
        """All slopes, those that correlate first."""
        return (*self.correlated, *self.independent)


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
        groupings = [name for part in self.random for name in columns_of(part.grouping)]
        return tuple(dict.fromkeys((self.rating, *self.predictors, *groupings)))


@dataclass(frozen=True)
class ModelOptions:
    """A formula in the words of the commands' options; `group_slopes` are those of further groupings.

    `correlated_slopes` are the covariates among independent slopes that correlate with the intercept.
    """

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
    correlated_slopes: tuple[str, ...] = ()


def parse_formula(text: str) -> Formula:
    """Read a formula.

    Raises
    ------
    InputError
        What is not written as names, +, *, :, and (effects | grouping); a model without an intercept or a
        grouping; an interaction without its parts.
    """
    # Names in backticks may hold anything, so that plain ones take their places while the formula is read.
    quoted = {f"quoted.{k}.": name for k, name in enumerate(_QUOTED.findall(text))}
    plain = text
    for mark, name in quoted.items():
        plain = plain.replace(f"`{name}`", mark, 1)
    rating, tilde, right = plain.partition("~")
    if not tilde or not _NAME.fullmatch(rating.strip()):
        raise InputError(f"expected a formula such as {EXAMPLE}, got '{text}'")
    rating = quoted.get(rating.strip(), rating.strip())
    as_factors = frozenset(quoted.get(name, name) for name in _FACTOR.findall(right))
    right = _FACTOR.sub(r"\1", right)
    reader = _Reader(text, quoted)
    random = reader.random_parts(_RANDOM.findall(right))
    # A bracket becomes the intercept, so that the pluses around it stay a valid sum.
    fixed, without_intercept = reader.effects(_RANDOM.sub("1", right))
    if without_intercept:
        raise InputError(f"'{text}' has no intercept (0 +), which is not supported; remove 0 +")
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
    return Formula(text, rating, fixed, random, as_factors)


def model_options(formula: Formula, header: Sequence[str], numeric: Collection[str]) -> ModelOptions:
    """What the formula means for a table: columns of numbers are covariates, others factors.

    Raises
    ------
    InputError
        A name that is not a column; correlated slopes of more than one grouping, or of a factor in addition
        to others.
    """
    for name in formula.columns:
        if name not in header:
            raise InputError(f"'{name}' in the formula is not a column{did_you_mean(name, header)}")
    correlated = [part for part in formula.random if part.correlated]
    if len(correlated) > 1:
        raise InputError(
            f"slopes of one grouping may correlate; write (1 + {':'.join(correlated[1].correlated[0])} || "
            f"{correlated[1].grouping}) for the other"
        )
    for part in formula.random:
        if part.slopes and "/" in part.grouping:
            raise InputError(
                f"the nested grouping {part.grouping} has no slopes; write (1 | {part.grouping})"
            )
    # The grouping whose slopes correlate, else the first, takes the participants' part.
    people = (correlated or list(formula.random))[0]
    if ":" in people.grouping and people.correlated:
        raise InputError(f"slopes by {people.grouping} cannot correlate; write || for independent slopes")
    if "/" in people.grouping or ":" in people.grouping:
        raise InputError(f"name another grouping before the nested {people.grouping}")
    factors = tuple(n for n in formula.predictors if n in formula.as_factors or n not in numeric)
    _refuse_slopes_of_factors(formula, people, factors)
    others = [part for part in formula.random if part is not people]
    first_item = next((part.grouping for part in others if "/" not in part.grouping), None)
    some_correlate = bool(people.correlated and people.independent)
    slopes: Slopes = "none" if not people.slopes else "all"
    if people.correlated and not people.independent:
        slopes = "correlated"
    return ModelOptions(
        people.grouping,
        formula.rating,
        factors,
        tuple(":".join(effect) for effect in formula.effects if not set(effect) <= set(factors)),
        () if first_item is None else tuple(first_item.split(":")),
        tuple(part.grouping for part in others if part.grouping != first_item),
        slopes,
        tuple(":".join(effect) for effect in formula.effects if set(effect) <= set(factors)),
        tuple(":".join(effect) for effect in people.slopes),
        tuple(
            (part.grouping, tuple(":".join(effect) for effect in part.slopes))
            for part in others
            if part.slopes
        ),
        tuple(":".join(effect) for effect in people.correlated) if some_correlate else (),
    )


def _refuse_slopes_of_factors(formula: Formula, people: RandomPart, factors: Collection[str]) -> None:
    """Refuse what R reads otherwise for a factor than for a column of numbers."""
    for part in formula.random:
        for effect in part.alone:
            if not set(factors).isdisjoint(effect):
                name = ":".join(effect)
                raise InputError(
                    f"(0 + {name} | {part.grouping}) gives each factor level a separate variance. "
                    f"Write (0 + {name} || {part.grouping}) for one variance"
                )
    if people.independent and any(len(e) > 1 or e[0] in factors for e in people.correlated):
        raise InputError(
            f"only columns of numbers may have slopes by {people.grouping} that correlate next to others "
            "that do not; write all of them in one bracket"
        )


def formula_name(name: str) -> str:
    """A column's name as it is written in a formula: in backticks where it would not be read as a name."""
    return name if _NAME.fullmatch(name) else f"`{name}`"


@dataclass(frozen=True)
class _Reader:
    """Reads parts of a formula; `whole` is the formula, `quoted` the names that stood in backticks."""

    whole: str
    quoted: dict[str, str]

    def random_parts(self, brackets: Sequence[tuple[str, str, str]]) -> tuple[RandomPart, ...]:
        """What is in the brackets, those of one grouping together."""
        parts: dict[str, RandomPart] = {}
        intercepts: list[str] = []
        for content, bar, of in brackets:
            effects, without_intercept = self.effects(content)
            grouping = self.grouping(of)
            if without_intercept and bar == "|" and len(effects) > 1:
                raise InputError(
                    f"'{self.whole}' has slopes by {grouping} that correlate without the intercept (0 +), "
                    "which is not supported; write || or remove 0 +"
                )
            if not without_intercept:
                intercepts.append(grouping)
            before = parts.get(grouping, RandomPart(grouping, (), (), ()))
            parts[grouping] = RandomPart(
                grouping,
                before.correlated + (effects if bar == "|" and not without_intercept else ()),
                before.independent + (effects if bar == "||" or without_intercept else ()),
                before.alone + (effects if bar == "|" and without_intercept else ()),
            )
        for grouping in parts:
            if intercepts.count(grouping) != 1:
                raise InputError(
                    f"'{self.whole}' has {intercepts.count(grouping) or 'no'} intercepts by {grouping}; "
                    f"write one, such as (1 | {grouping}), and 0 + in further brackets"
                )
        return tuple(parts.values())

    def effects(self, text: str) -> tuple[tuple[Effect, ...], bool]:
        """Effects of `a*b + c`, where a*b is a + b + a:b; and whether the intercept is taken out."""
        effects: dict[frozenset[str], Effect] = {}
        without_intercept = False
        for term in (part.strip() for part in text.split("+")):
            without_intercept |= term == "0"
            members = [] if term in ("0", "1") else [part.strip() for part in re.split(r"[*:]", term)]
            if not all(_NAME.fullmatch(name) for name in members) or ("*" in term and ":" in term):
                raise InputError(
                    f"'{self._as_written(term)}' in '{self.whole}' is not understood; expected names joined "
                    f"by +, * or :, as in {EXAMPLE}"
                )
            members = list(dict.fromkeys(self.quoted.get(n, n) for n in members))  # a:a is a
            sizes = range(1, len(members) + 1) if "*" in term else [len(members)]
            for effect in chain.from_iterable(combinations(members, size) for size in sizes):
                effects.setdefault(frozenset(effect), effect)
        return tuple(sorted((effect for effect in effects.values() if effect), key=len)), without_intercept

    def grouping(self, text: str) -> str:
        """A grouping: a column, a/b for b within a, or a:b for both columns together."""
        parts = [part.strip() for part in re.split("([/:])", text)]
        if not all(_NAME.fullmatch(part) for part in parts[::2]) or {"/", ":"} <= set(parts):
            raise InputError(
                f"'{self._as_written(text.strip())}' in '{self.whole}' is not a grouping; expected person, "
                "lab/room or profile:clip"
            )
        return "".join(self.quoted.get(part, part) for part in parts)

    def _as_written(self, text: str) -> str:
        for mark, name in self.quoted.items():
            text = text.replace(mark, f"`{name}`")
        return text
