"""Figures of an analysis, after the paper's 9, 10 and 11: means with within-participant error bars, and
every participant visible behind them. The same data give the same bytes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import special

from analysis.plans.result import Analysis
from analysis.report.contents import in_words
from analysis.report.pictures import BESIDE, COLOURS, MARKERS, STYLE, new_figure, wrap_text, write_note
from analysis.within.anova import AnovaResult
from analysis.within.estimates import margin, margin_of
from experiments.declaration.trial import RatedScale
from experiments.error_bars import within_participant_errors
from experiments.kinds.scales import scale_called

Floats = NDArray[np.float64]

MAX_KEY = 200
"""Characters of a figure's key; names of files may have 255 bytes."""
LEGEND_CHARACTERS, TITLE_CHARACTERS, HEIGHT_CHARACTERS, AXIS_CHARACTERS = 22, 62, 52, 72
"""Characters in a line of the legend, of titles, of the axis of ratings, of all names along the axis."""
_CLOUD_STEPS = 60

_SPREAD = 0.62
"""Width of a group of conditions on an axis where groups are 1 apart."""


@dataclass(frozen=True)
class FigureSpec:
    """What to draw: the factors along the axis (several are combined), and the factor shown by color.

    `key` names its files and its label in LaTeX: letters, digits, `-` and `_` of ASCII.
    """

    key: str
    title: str
    along: tuple[str, ...]
    colour: str | None = None
    style: Literal["points", "lines"] = "points"


_OF_EXPERIMENT: dict[str, tuple[FigureSpec, ...]] = {
    "exp1": (
        FigureSpec(
            "figure-9",
            "Real and model blinks, by closing amplitude and motion blur",
            ("amplitude", "blur"),
            "profile",
        ),
        FigureSpec("figure-10", "Closing amplitude on both characters", ("amplitude",), "character"),
    ),
    "exp2": (
        FigureSpec("figure-11", "Blink profiles by duration", ("duration",), "profile", "lines"),
        FigureSpec(
            "figure-11-character", "Durations on both characters", ("duration",), "character", "lines"
        ),
    ),
    "exp3": (FigureSpec("figure-lower-lid", "Motion of the lower lid", ("lower_lid",)),),
}


def figures_of(analysis: Analysis) -> tuple[FigureSpec, ...]:
    """The figures of the paper for its experiments; for others each factor, and pairs of factors."""
    known = _OF_EXPERIMENT.get(analysis.name, ())
    factors = set(analysis.anova.all_factors)
    if known and all({*spec.along, *([spec.colour] if spec.colour else [])} <= factors for spec in known):
        return known
    names = analysis.anova.all_factors
    if len(names) == 1:
        (key,) = _keys([names])
        return (FigureSpec(key, analysis.labels.factor(names[0]), names),)
    pairs = list(combinations(names, 2))[:6]
    return tuple(
        FigureSpec(key, f"{analysis.labels.factor(a)} and {analysis.labels.factor(b)}", (a,), b)
        for key, (a, b) in zip(_keys(pairs), pairs, strict=True)
    )


def _keys(shown: Sequence[tuple[str, ...]]) -> list[str]:
    """A key for the factors of each figure: what no file system and no TeX reads otherwise, all different."""
    keys: list[str] = []
    for factors in shown:
        plain = [re.sub(r"[^A-Za-z0-9_-]+", "-", factor).strip("-") or "factor" for factor in factors]
        key = again = f"figure-{'-'.join(plain)}"[:MAX_KEY]
        number = 1
        while again.lower() in map(str.lower, keys):
            number += 1
            again = f"{key}-{number}"
        keys.append(again)
    return keys


def draw(analysis: Analysis, spec: FigureSpec) -> Figure:
    """Draw one figure."""
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_subplot()
        _conditions(axes, analysis, spec)
        _dress(axes, analysis, spec)
        marks = "Points, thin lines and clouds" if spec.style == "points" else "Points and thin lines"
        said = f"{marks}: participants. {bars_of(analysis)}"
        write_note(figure, f"N = {analysis.n_participants}. {said}", analysis.synthetic)
    return figure


def bars_of(analysis: Analysis) -> str:
    """What the means and error bars of a figure are.

    With groups or covariates they are the estimated marginal means of the table, and their intervals.
    """
    if _of_participants_alone(analysis):
        return "Bars: 95% within-participant CI (Cousineau-Morey)."
    covariates = ", ".join(covariate.name for covariate in analysis.anova.between.covariates)
    adjusted = f" at the mean of {covariates} (participants' points are not adjusted)" if covariates else ""
    return f"Means and bars: estimated marginal means{adjusted} and their 95% CI, as in the table."


def _of_participants_alone(analysis: Analysis) -> bool:
    """Whether the design has neither groups nor covariates."""
    return not analysis.anova.between.factors and not analysis.anova.between.covariates


@dataclass(frozen=True)
class _Shown:
    """What a figure shows of each condition.

    Attributes
    ----------
    values : (N, groups, shades) array
        Participants' means; NaN where a participant belongs to another group.
    means, errors : (groups, shades) array
        Means and half the widths of their intervals.
    groups, shades : list of str
        Names along the axis, and of the colors.
    """

    values: Floats
    means: Floats
    errors: Floats
    groups: list[str]
    shades: list[str]


def _conditions(axes: Axes, analysis: Analysis, spec: FigureSpec) -> None:
    shown = _arranged(analysis, spec)
    values, groups, shades = shown.values, shown.groups, shown.shades
    n_groups, n_shades = len(groups), len(shades)
    offsets = (np.arange(n_shades) - (n_shades - 1) / 2) * _SPREAD / n_shades
    room = _SPREAD / n_shades
    jitter = (
        0.16 * _jitter(len(values)) - 0.24 if spec.style == "points" else 0.34 * _jitter(len(values))
    ) * room
    for shade in range(n_shades):
        at = np.arange(n_groups) + offsets[shade]
        colour = COLOURS[shade % len(COLOURS)]
        if n_groups > 1:
            people = at[:, None] + jitter[None, :]
            axes.plot(people, values[:, :, shade].T, color=colour, alpha=0.12, linewidth=0.5, zorder=1)
        for group in range(n_groups):
            if spec.style == "points":
                there = values[~np.isnan(values[:, group, shade]), group, shade]
                _cloud(axes, at[group] + 0.06 * room, there, 0.38 * room, colour)
            axes.plot(
                at[group] + jitter,
                values[:, group, shade],
                linestyle="none",
                marker="o",
                markersize=2.6,
                markeredgewidth=0,
                color=colour,
                alpha=0.25,
            )
        axes.errorbar(
            at,
            shown.means[:, shade],
            yerr=shown.errors[:, shade],
            color=colour,
            marker=MARKERS[shade % len(MARKERS)],
            linestyle="-" if spec.style == "lines" else "none",
            linewidth=1.2,
            markersize=4.6,
            markeredgecolor="white",
            markeredgewidth=0.5,
            capsize=3.2,
            elinewidth=1.3,
            label=wrap_text(shades[shade], LEGEND_CHARACTERS),
            zorder=3,
        )
    axes.set_xticks(range(n_groups), [wrap_text(name, AXIS_CHARACTERS // n_groups) for name in groups])


def _cloud(axes: Axes, x: float, values: Floats, width: float, colour: str) -> None:
    """The distribution of participants, to the right of a condition; their points lie left of it."""
    if len(values) < 3 or np.ptp(values) == 0:
        return
    heights = np.linspace(values.min(), values.max(), _CLOUD_STEPS)
    density = _density(values, heights)
    reach = x + width * density / density.max()
    axes.fill_betweenx(heights, x, reach, color=colour, alpha=0.13, linewidth=0, zorder=0)


def _density(values: Floats, at: Floats) -> Floats:
    """Gaussian kernels of Scott's width, n to the power of -1/5 SDs (scipy's `gaussian_kde`, unscaled)."""
    width = values.std(ddof=1) * len(values) ** -0.2
    kernels = np.exp(-(((at[:, None] - values) / width) ** 2) / 2)
    return np.asarray(kernels.sum(axis=1), dtype=np.float64)


def _arranged(analysis: Analysis, spec: FigureSpec) -> _Shown:
    """The conditions of the figure's margin: those along the axis, by the levels that have a color."""
    result = analysis.anova
    named = [*spec.along, *([spec.colour] if spec.colour else [])]
    of_margin = margin_of(result, named)
    levels = dict(zip(result.all_factors, result.all_levels, strict=True))
    sizes = [len(levels[name]) for name in of_margin.names]
    order = [of_margin.names.index(name) for name in named]
    members = tuple(m for m, name in enumerate(result.factors) if name in named)
    own = _by_group(result, [name for name in of_margin.names if name not in result.factors])
    values = (own[:, :, None] * margin(result, members)[:, None, :]).reshape(-1, *sizes)
    means = of_margin.means.reshape(sizes)
    if _of_participants_alone(analysis):
        flat = values.reshape(len(values), -1).tolist()
        errors = np.array(within_participant_errors(flat)).reshape(sizes)
        reach = float(special.stdtrit(len(values) - 1, 0.975))
    else:
        errors = of_margin.contrasts(np.eye(means.size))[1].reshape(sizes)
        reach = float(special.stdtrit(of_margin.df, 0.975))
    combinations_along = list(product(*(levels[name] for name in spec.along)))
    groups = [_name(analysis, dict(zip(spec.along, row, strict=True))) for row in combinations_along]
    shades = (
        [analysis.labels.level(spec.colour, name) for name in levels[spec.colour]] if spec.colour else [""]
    )
    shape = len(groups), len(shades)
    return _Shown(
        np.moveaxis(values, [i + 1 for i in order], range(1, len(order) + 1)).reshape(-1, *shape),
        means.transpose(order).reshape(shape),
        reach * errors.transpose(order).reshape(shape),
        groups,
        shades,
    )


def _by_group(result: AnovaResult, factors: Sequence[str]) -> Floats:
    """1 in the own group of a participant, NaN in others: (N, groups) of these factors between people."""
    design = result.between
    at = [design.factors.index(name) for name in factors]
    sizes = [len(design.levels[k]) for k in at]
    own = np.zeros(result.n_participants, np.int64)
    if at:
        own = np.ravel_multi_index(tuple(design.codes[:, k] for k in at), sizes).astype(np.int64)
    marks = np.full((result.n_participants, int(np.prod(sizes, initial=1))), np.nan)
    marks[np.arange(len(own)), own] = 1.0
    return marks


def _name(analysis: Analysis, levels: dict[str, str]) -> str:
    return "\n".join(analysis.labels.level(factor, level) for factor, level in levels.items())


def _jitter(n: int) -> Floats:
    """Evenly spread offsets in [-1, 1] in an order that looks random and is not."""
    golden = np.arange(1, n + 1) * 0.6180339887498949
    spread: Floats = 2 * (golden - np.floor(golden)) - 1
    return spread


def _asked(what: str, scale: RatedScale, language: str) -> str:
    """What the axis of ratings is called: the ends of the scale as participants read them."""
    low = f"{scale.minimum:g} {scale.low.get(language, '')}".strip()
    high = f"{scale.maximum:g} {scale.high.get(language, '')}".strip()
    return f"{what} ({low} – {high})"


def _dress(axes: Axes, analysis: Analysis, spec: FigureSpec) -> None:
    axes.set_title(wrap_text(spec.title, TITLE_CHARACTERS), fontsize=10, loc="left")
    along = " × ".join(analysis.labels.factor(name) for name in spec.along)
    axes.set_xlabel(wrap_text(along, TITLE_CHARACTERS))
    axes.set_ylabel(wrap_text(analysis.rating, HEIGHT_CHARACTERS))
    if analysis.experiment is not None:
        scale = scale_called(analysis.experiment, None if analysis.rating == "response" else analysis.rating)
        what = "Rating" if analysis.rating == "response" else in_words(scale.name)
        asked = _asked(what, scale, analysis.experiment.languages[0])
        axes.set_ylabel(wrap_text(asked, HEIGHT_CHARACTERS))
        margin = (scale.maximum - scale.minimum) / 30
        axes.set_ylim(scale.minimum - margin, scale.maximum + margin)
        if scale.type == "points":
            axes.set_yticks(range(round(scale.minimum), round(scale.maximum) + 1))
    axes.grid(axis="y", linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)
    if spec.colour:
        title = wrap_text(analysis.labels.factor(spec.colour), LEGEND_CHARACTERS)
        axes.legend(title=title, frameon=False, fontsize=8, title_fontsize=8, **BESIDE)
