"""Features that reveal the levels of a factor: confounds that a manifest shows.

For each factor, the clips are tabulated by level and by each feature that raters could notice: where the lids
rest at the start and end, how far the two differ, length, frame rate, size and brightness. A level can be
recognized better than chance if Pearson's chi-square of that table is large (p < 0.001), or if each level has
a value that no other level has. A difference between levels may then be due to the feature instead of the
factor.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import erfc, exp, lgamma, log, sqrt

from experiments.manifest import Clip

ALPHA = 0.001
"""Tables of levels by values with a smaller chance probability are reported."""
MASS = 0.1
"""A value shared by at least this proportion of the clips forms a separate group."""
GROUPS = 4
"""Number of groups of equal size for all other values."""
DECIMALS = 3
Value = float | str
Table = dict[str, Counter[object]]

LENGTH, RATE, SIZE = "number of frames", "frame rate", "picture size"
ONSET = "frame at which the blink begins"
BYTES = "size of the file"
BRIGHTNESS = ("brightness of the first frame", "brightness of the last frame")
TABULATED_ONLY = frozenset({BYTES})
"""Raters cannot see these features, so they are tabulated but never reported."""


@dataclass(frozen=True)
class LevelLeak:
    """How well a feature of the clips reveals the levels of a factor.

    Attributes
    ----------
    factor, feature : str
    level : str
        The level that the feature reveals best.
    right, others : float
        Share of the clips of this level, and of all other clips, that a guess from the feature gets right.
        Without any relation, they add up to 1.
    clips : int
        Clips that were compared; the same blink shown in several cells counts once.
    p_value : float
        Of Pearson's chi-square of levels by groups of values; 0 if every level has a unique value.
    """

    factor: str
    feature: str
    level: str
    right: float
    others: float
    clips: int
    p_value: float

    @property
    def reported(self) -> bool:
        """Whether the feature reveals the levels, and raters can notice it."""
        return self.p_value < ALPHA and self.feature not in TABULATED_ONLY

    def __str__(self) -> str:
        return (
            f"the {self.feature} reveals the level '{self.level}' of '{self.factor}': it alone is enough to "
            f"classify {self.right:.0%} of the clips of this level and {self.others:.0%} of the other clips "
            f"correctly ({self.clips} clips). If '{self.factor}' changes it on purpose, ignore this. "
            f"Otherwise raters may judge it instead: give all levels the same {self.feature}"
        )


def level_leaks(
    clips: Sequence[Clip], measured: Mapping[str, Mapping[str, Value]] | None = None
) -> tuple[LevelLeak, ...]:
    """How well each feature reveals each factor's levels, in the order of factors and features.

    Parameters
    ----------
    clips : sequence of Clip
        Of a manifest.
    measured : mapping of str to mapping of str to Value, optional
        Further features, each with the value of every clip by its hash, such as the brightness of frames.
    """
    features: dict[str, Callable[[Clip], Value | None]] = dict(_FEATURES)
    for name, values in (measured or {}).items():
        features[name] = _by_hash(values)
    factors = list(clips[0].levels) if clips else []
    own = {factor: _features_of(clips, factor) for factor in factors}
    return tuple(
        leak
        for factor in factors
        for name, value_of in features.items()
        if name not in own[factor]
        for leak in [_judged(clips, factor, name, value_of, [f for f in factors if name in own[f]])]
        if leak is not None
    )


def reported_leaks(
    clips: Sequence[Clip], measured: Mapping[str, Mapping[str, Value]] | None = None
) -> list[str]:
    """The features that reveal levels, one sentence each."""
    return [str(leak) for leak in level_leaks(clips, measured) if leak.reported]


def _by_hash(values: Mapping[str, Value]) -> Callable[[Clip], Value | None]:
    return lambda clip: values.get(clip.sha256)


def _end_of(signal: str, index: int) -> Callable[[Clip], Value | None]:
    def value(clip: Clip) -> Value | None:
        samples = getattr(clip, signal)
        return samples[index] if samples else None

    return value


def _step_of(signal: str) -> Callable[[Clip], Value | None]:
    def value(clip: Clip) -> Value | None:
        samples = getattr(clip, signal)
        return abs(samples[-1] - samples[0]) if samples else None

    return value


_SIGNALS = {
    "closure": "lid",
    "closure_other": "right eye's lid",
    "lower_vertical_mm": "lower lid (lift)",
    "lower_horizontal_mm": "lower lid (slide)",
}
_FEATURES: dict[str, Callable[[Clip], Value | None]] = {
    **{f"first position of the {words}": _end_of(signal, 0) for signal, words in _SIGNALS.items()},
    **{f"last position of the {words}": _end_of(signal, -1) for signal, words in _SIGNALS.items()},
    **{f"step from first to last position of the {words}": _step_of(key) for key, words in _SIGNALS.items()},
    LENGTH: lambda clip: float(clip.frames),
    ONSET: lambda clip: None if clip.onset_frame is None else float(clip.onset_frame),
    RATE: lambda clip: clip.fps,
    SIZE: lambda clip: f"{clip.width_px} x {clip.height_px}",
    BYTES: lambda clip: float(clip.bytes),
}  # fmt: skip

LID_ENDS = {
    f"{end} position of the {_SIGNALS[eye]}"
    for end in ("first", "last")
    for eye in ("closure", "closure_other")
}


def _features_of(clips: Sequence[Clip], factor: str) -> set[str]:
    """The features that a factor of rendered clips varies on purpose, because it sets the character or
    length."""
    if not all("character" in clip.inputs for clip in clips):
        return set()
    set_on_purpose: set[str] = set()
    if _sets(clips, factor, lambda clip: clip.inputs["character"]):
        set_on_purpose |= {SIZE, BYTES, *BRIGHTNESS}
    if _sets(clips, factor, lambda clip: clip.fps):
        set_on_purpose |= {RATE, LENGTH, ONSET, BYTES}
    # With them the lids rest lower, to have room above.
    if _sets(clips, factor, lambda clip: (clip.inputs.get("anticipation"), clip.inputs.get("settle"))):
        set_on_purpose |= LID_ENDS
    if _sets(clips, factor, lambda clip: clip.duration_frames):
        set_on_purpose |= {LENGTH, BYTES}
    return set_on_purpose


def _sets(clips: Sequence[Clip], factor: str, value_of: Callable[[Clip], object]) -> bool:
    """Whether all clips of a level share one value, and levels differ in it."""
    values: defaultdict[str, set[object]] = defaultdict(set)
    for clip in clips:
        values[clip.levels[factor]].add(value_of(clip))
    return all(len(of) == 1 for of in values.values()) and len(set(map(frozenset, values.values()))) > 1


def _judged(
    clips: Sequence[Clip],
    factor: str,
    feature: str,
    value_of: Callable[[Clip], Value | None],
    set_by: Sequence[str],
) -> LevelLeak | None:
    """How well one feature reveals one factor's levels; None if only one level has it.

    Clips are compared within the levels of the factors that set the feature on purpose. A blink that several
    cells share is one observation; otherwise it would be guessed from its own copies.
    """
    seen: dict[tuple[object, ...], tuple[tuple[str, ...], str, Value]] = {}
    for clip in clips:
        value = value_of(clip)
        if value is None:
            continue
        value = round(value, DECIMALS) if isinstance(value, float) else value
        stratum = tuple(clip.levels[other] for other in set_by)
        level = clip.levels[factor]
        alike = (stratum, level, clip.profile, clip.exemplar, value) if clip.profile else (clip.sha256, level)
        seen[alike] = (stratum, level, value)
    strata: defaultdict[tuple[str, ...], list[tuple[str, Value]]] = defaultdict(list)
    for stratum, level, value in seen.values():
        strata[stratum].append((level, value))
    tables = [_table(members) for members in strata.values()]
    statistics = [pearson_statistic(table) for table in tables if len(table) > 1]
    if not statistics:
        return None
    p_value = chi_square_tail(sum(x for x, _ in statistics), sum(df for _, df in statistics))
    apart = _gives_a_level_away if feature in (RATE, SIZE) else _separates
    if all(map(apart, tables)):
        p_value = 0.0
    shares = {level: _guessed(tables, level) for level in sorted({one for table in tables for one in table})}
    level = max(shares, key=lambda one: sum(shares[one]))
    return LevelLeak(factor, feature, level, *shares[level], len(seen), p_value)


def _table(members: Sequence[tuple[str, Value]]) -> Table:
    """Level -> group of values -> number of clips."""
    group_of = grouped_values([value for _, value in members])
    table: defaultdict[str, Counter[object]] = defaultdict(Counter)
    for level, value in members:
        table[level][group_of(value)] += 1
    return dict(table)


def pearson_statistic(table: Table) -> tuple[float, int]:
    """Pearson's chi-square of a table of counts, and its degrees of freedom.

    >>> pearson_statistic({"a": Counter(x=10), "b": Counter(y=10)})
    (20.0, 1)
    """
    columns: Counter[object] = Counter()
    for row in table.values():
        columns.update(row)
    total = columns.total()
    statistic = 0.0
    for row in table.values():
        for column, count in columns.items():
            expected = row.total() * count / total
            statistic += (row[column] - expected) ** 2 / expected
    return statistic, (len(table) - 1) * (len(columns) - 1)


def chi_square_tail(statistic: float, df: int) -> float:
    """P(X >= statistic) of a chi-square distribution with a whole number of degrees of freedom.

    By the recurrence Q(x, df) = Q(x, df - 2) + (x / 2)^(df / 2 - 1) exp(-x / 2) / Gamma(df / 2)
    (Abramowitz and Stegun 1964, 26.4.8).

    >>> round(chi_square_tail(10.83, 1), 4), round(chi_square_tail(16.27, 3), 4)
    (0.001, 0.001)
    """
    if df == 0 or statistic <= 0:
        return 1.0
    half = statistic / 2
    tail = erfc(sqrt(half)) if df % 2 else exp(-half)
    for step in range(3 if df % 2 else 4, df + 1, 2):
        tail += exp((step / 2 - 1) * log(half) - half - lgamma(step / 2))
    return tail


def _separates(table: Table) -> bool:
    """Whether there are several levels with at least two clips each, all in one group that no other level
    has."""
    groups = [set(row) for row in table.values()]
    alone = all(len(group) == 1 for group in groups) and len(set().union(*groups)) == len(groups)
    return len(table) > 1 and alone and min(row.total() for row in table.values()) > 1


def _gives_a_level_away(table: Table) -> bool:
    """Whether all clips of a level (at least two) share one value that no other level has.

    For features that do not vary by chance: rates and sizes are the same unless they were changed.
    """
    for level, row in table.items():
        others = set().union(*(set(other) for name, other in table.items() if name != level))
        if len(row) == 1 and row.total() > 1 and not set(row) & others and others:
            return True
    return False


def _guessed(tables: Sequence[Table], level: str) -> tuple[float, float]:
    """Share of the clips of a level, and of the others, that a guess from the groups gets right.

    A clip is guessed to belong to the level if its group holds a larger share of that level's clips than of
    the others; equal shares count half.
    """
    right, others, of_level, of_others = 0.0, 0.0, 0, 0
    for table in tables:
        mine, rest = table.get(level, Counter()), Counter[object]()
        for other, row in table.items():
            if other != level:
                rest.update(row)
        if not mine or not rest:
            continue
        of_level, of_others = of_level + mine.total(), of_others + rest.total()
        for group in set(mine) | set(rest):
            lead = mine[group] / mine.total() - rest[group] / rest.total()
            weight = 0.5 if lead == 0 else float(lead > 0)
            right, others = right + weight * mine[group], others + (1 - weight) * rest[group]
    return right / max(of_level, 1), others / max(of_others, 1)


def grouped_values(values: Sequence[Value]) -> Callable[[Value], object]:
    """Group values: a frequent value is a group, and all others are divided into groups of equal size."""
    counts = Counter(values)
    if len(counts) <= GROUPS or any(isinstance(value, str) for value in values):
        return lambda value: value
    common = {value for value, count in counts.items() if count >= MASS * len(values)}
    rest = sorted(float(value) for value in values if value not in common)
    cuts = [rest[len(rest) * k // GROUPS] for k in range(1, GROUPS)] if rest else []

    def group(value: Value) -> object:
        return value if value in common else ("among the rest", sum(float(value) >= cut for cut in cuts))

    return group
