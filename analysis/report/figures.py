"""Figures of an analysis, after the paper's 9, 10 and 11: means with within-participant error bars, and
every participant visible behind them. The same data give the same bytes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import special

from analysis.plans.result import Analysis
from analysis.report.captions import in_words
from analysis.report.pictures import BESIDE, COLOURS, MARKERS, STYLE, new_figure, write_note
from analysis.within.marginal_means import level_combinations, margin
from experiments.error_bars import within_participant_errors
from experiments.trials.scales import RatedScale, scale_called

Floats = NDArray[np.float64]

MAX_KEY = 200
"""Characters of a figure's key; names of files may have 255 bytes."""
_CLOUD_STEPS = 60

_SPREAD = 0.62
"""Width of a group of conditions on an axis where groups are 1 apart."""


@dataclass(frozen=True)
class FigureSpec:
    """What to draw: the factors along the axis (several are combined), and the factor shown by colour.

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
    factors = set(analysis.anova.factors)
    if known and all({*spec.along, *([spec.colour] if spec.colour else [])} <= factors for spec in known):
        return known
    names = analysis.anova.factors
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
        said = f"{marks}: participants. Bars: 95% CI within participants (Cousineau-Morey)."
        write_note(figure, f"N = {analysis.n_participants}. {said}", analysis.synthetic)
    return figure


def _conditions(axes: Axes, analysis: Analysis, spec: FigureSpec) -> None:
    values, groups, shades = _arranged(analysis, spec)
    n_groups, n_shades = len(groups), len(shades)
    reach = float(special.stdtrit(len(values) - 1, 0.975))
    flat = values.reshape(len(values), -1)
    errors = reach * np.array(within_participant_errors(flat.tolist())).reshape(n_groups, n_shades)
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
                _cloud(axes, at[group] + 0.06 * room, values[:, group, shade], 0.38 * room, colour)
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
            values[:, :, shade].mean(axis=0),
            yerr=errors[:, shade],
            color=colour,
            marker=MARKERS[shade % len(MARKERS)],
            linestyle="-" if spec.style == "lines" else "none",
            linewidth=1.2,
            markersize=4.6,
            markeredgecolor="white",
            markeredgewidth=0.5,
            capsize=3.2,
            elinewidth=1.3,
            label=shades[shade],
            zorder=3,
        )
    axes.set_xticks(range(n_groups), groups)


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


def _arranged(analysis: Analysis, spec: FigureSpec) -> tuple[Floats, list[str], list[str]]:
    """Participants' means (N, groups, shades) of the figure's margin, and the names of both."""
    factors = analysis.anova.factors
    named = [*spec.along, *([spec.colour] if spec.colour else [])]
    members = tuple(sorted(factors.index(name) for name in named))
    sizes = [len(analysis.anova.levels[m]) for m in members]
    values: Floats = margin(analysis.anova, members).reshape(-1, *sizes)
    order = [[factors[m] for m in members].index(name) for name in named]
    values = np.moveaxis(values, [i + 1 for i in order], range(1, len(order) + 1))
    along = tuple(factors.index(name) for name in spec.along)
    groups = [_name(analysis, levels) for levels in level_combinations(analysis.anova, along)]
    shades = [""]
    if spec.colour:
        levels = analysis.anova.levels[factors.index(spec.colour)]
        shades = [analysis.labels.level(spec.colour, level) for level in levels]
    return values.reshape(len(values), len(groups), len(shades)), groups, shades


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
    axes.set_title(spec.title, fontsize=10, loc="left")
    axes.set_xlabel(" × ".join(analysis.labels.factor(name) for name in spec.along))
    axes.set_ylabel(analysis.rating)
    if analysis.experiment is not None:
        scale = scale_called(analysis.experiment, None if analysis.rating == "response" else analysis.rating)
        what = "Rating" if analysis.rating == "response" else in_words(scale.name)
        axes.set_ylabel(_asked(what, scale, analysis.experiment.languages[0]))
        margin = (scale.maximum - scale.minimum) / 30
        axes.set_ylim(scale.minimum - margin, scale.maximum + margin)
        if scale.type == "points":
            axes.set_yticks(range(round(scale.minimum), round(scale.maximum) + 1))
    axes.grid(axis="y", linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)
    if spec.colour:
        title = analysis.labels.factor(spec.colour)
        axes.legend(title=title, frameon=False, fontsize=8, title_fontsize=8, **BESIDE)
