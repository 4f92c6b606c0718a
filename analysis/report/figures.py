"""Figures of reports. The same data give the same bytes.

Those of clip ratings follow the paper's 9, 10 and 11: means with within-participant error bars, and every
participant visible behind them.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import special, stats

from analysis.models.residuals import ResidualChecks
from analysis.pairs.abilities import PairsResult
from analysis.pairs.findings import PairCount
from analysis.plans.result import Analysis
from analysis.report.contents import Picture, in_words
from analysis.report.numbers import fixed
from analysis.report.pictures import (
    BESIDE,
    COLOURS,
    MARKERS,
    STYLE,
    draw_estimates,
    in_both_formats,
    new_figure,
    spread_offsets,
    wrap_text,
    write_note,
)
from analysis.traces import LagResult, MeanTrace
from analysis.within.estimates import group_membership, margin, margin_of
from analysis.within.simple_effects import SIGNIFICANCE
from experiments.declaration.trial import RatedScale
from experiments.error_bars import within_participant_errors
from experiments.kinds import scale_called

if TYPE_CHECKING:
    from analysis.plans.multiverse import Multiverse


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
    # A study may share its name with an experiment of the paper and still have other factors.
    if known and all({*spec.along, *([spec.colour] if spec.colour else [])} <= factors for spec in known):
        return known
    names = analysis.anova.all_factors
    if len(names) == 1:
        (key,) = _keys([names])
        return (FigureSpec(key, analysis.labels.factor(names[0]), names),)
    # Six are all pairs of four factors.
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
        # Case is ignored: on some file systems figure-A and figure-a are one file.
        while again.lower() in map(str.lower, keys):
            number += 1
            again = f"{key}-{number}"
        keys.append(again)
    return keys


def draw(analysis: Analysis, spec: FigureSpec) -> tuple[Figure, str]:
    """Draw one figure; it, and what its means and error bars are."""
    shown = _arranged(analysis, spec)
    bars = _bars_of(analysis, shown)
    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_subplot()
        _conditions(axes, shown, spec.style)
        _dress(axes, analysis, spec)
        marks = "Points, thin lines and clouds" if spec.style == "points" else "Points and thin lines"
        write_note(
            figure, f"N = {analysis.n_participants}. {marks}: participants. {bars}", analysis.synthetic
        )
    return figure, bars


def _bars_of(analysis: Analysis, shown: "_Shown") -> str:
    """What the means and error bars of a figure are, and whether bars are cut at the ends of the scale.

    With groups or covariates they are the estimated marginal means of the table, and their intervals.
    """
    cut = " Bars are cut at the ends of the scale." if _has_cut_bars(analysis, shown) else ""
    if _of_participants_alone(analysis):
        return f"Bars: 95% within-participant CI (Cousineau-Morey).{cut}"
    covariates = ", ".join(covariate.name for covariate in analysis.anova.between.covariates)
    adjusted = f" at the mean of {covariates} (participants' points are not adjusted)" if covariates else ""
    return f"Means and bars: estimated marginal means{adjusted} and their 95% CI, as in the table.{cut}"


def _has_cut_bars(analysis: Analysis, shown: "_Shown") -> bool:
    """Whether an interval of a declared study reaches beyond its scale, where the axis ends."""
    scale = _scale_of(analysis)
    if scale is None:
        return False
    low, high = shown.means - shown.errors, shown.means + shown.errors
    return bool((low < scale.minimum).any() or (high > scale.maximum).any())


def _scale_of(analysis: Analysis) -> RatedScale | None:
    """The declared scale of the analyzed ratings; None for a table without a declaration."""
    if analysis.experiment is None:
        return None
    return scale_called(analysis.experiment, None if analysis.rating == "response" else analysis.rating)


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


def _conditions(axes: Axes, shown: _Shown, style: Literal["points", "lines"]) -> None:
    values, groups, shades = shown.values, shown.groups, shown.shades
    n_groups, n_shades = len(groups), len(shades)
    offsets = (np.arange(n_shades) - (n_shades - 1) / 2) * _SPREAD / n_shades
    room = _SPREAD / n_shades
    # With clouds, points move to the left and leave the right half to the cloud.
    jitter = (
        0.16 * spread_offsets(len(values)) - 0.24 if style == "points" else 0.34 * spread_offsets(len(values))
    ) * room
    for shade in range(n_shades):
        at = np.arange(n_groups) + offsets[shade]
        colour = COLOURS[shade % len(COLOURS)]
        # Thin lines connect the conditions of a participant; one group has nothing to connect.
        if n_groups > 1:
            people = at[:, None] + jitter[None, :]
            axes.plot(people, values[:, :, shade].T, color=colour, alpha=0.12, linewidth=0.5, zorder=1)
        for group in range(n_groups):
            if style == "points":
                # Participants of other groups are NaN here.
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
            linestyle="-" if style == "lines" else "none",
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
    density = stats.gaussian_kde(values)(heights)
    # Scaled to the widest place: the width of a cloud says nothing of how many it has.
    reach = x + width * density / density.max()
    axes.fill_betweenx(heights, x, reach, color=colour, alpha=0.13, linewidth=0, zorder=0)


def _arranged(analysis: Analysis, spec: FigureSpec) -> _Shown:
    """The conditions of the figure's margin: those along the axis, by the levels that have a color."""
    result = analysis.anova
    named = [*spec.along, *([spec.colour] if spec.colour else [])]
    of_margin = margin_of(result, named)
    levels = dict(zip(result.all_factors, result.all_levels, strict=True))
    sizes = [len(levels[name]) for name in of_margin.names]
    order = [of_margin.names.index(name) for name in named]
    members = tuple(m for m, name in enumerate(result.factors) if name in named)
    own = group_membership(result, [name for name in of_margin.names if name not in result.factors])
    # Times 1 or NaN: each participant has values only in the columns of the own group.
    values = (own[:, :, None] * margin(result, members)[:, None, :]).reshape(-1, *sizes)
    means = of_margin.means.reshape(sizes)
    if _of_participants_alone(analysis):
        flat = values.reshape(len(values), -1).tolist()
        # These are standard errors; `reach` makes them half the width of an interval.
        errors = np.array(within_participant_errors(flat)).reshape(sizes)
        reach = float(special.stdtrit(len(values) - 1, 0.975))
    else:
        # Identity weights: every mean is a contrast, and its standard error comes second.
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


def _name(analysis: Analysis, levels: dict[str, str]) -> str:
    return "\n".join(analysis.labels.level(factor, level) for factor, level in levels.items())


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
    scale = _scale_of(analysis)
    if analysis.experiment is not None and scale is not None:
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


# Figures of paired comparisons: abilities, and the choices in each pair.

NUMBERED_MAX = 14
"""More items than this and the shares are colors without numbers."""


def draw_abilities(result: PairsResult, synthetic: bool, people: int) -> Picture:
    """Abilities against their mean with 95% intervals, the ablest on top."""
    ranked = sorted(result.items, key=lambda item: (-item.rank, item.name))[::-1]
    reach = float(stats.norm.ppf(0.975))
    rows = [
        (one.name, one.centred, one.centred - reach * one.se_centred, one.centred + reach * one.se_centred)
        for one in ranked
    ]
    return draw_estimates(
        "figure-abilities",
        "Abilities",
        f"Ability relative to the mean, {result.scale}",
        rows,
        f"N = {people}, {result.n_comparisons} comparisons. Bars: 95% intervals, sum-to-zero.",
        synthetic,
        what="comparisons",
        alt=f"Abilities of {len(rows)} cells with 95% intervals; {ranked[0].name} was chosen most often",
        reference=0.0,
    )


def draw_choices(pairs: Sequence[PairCount], synthetic: bool, people: int) -> Picture:
    """Share of comparisons in which the row's cell was chosen over the column's, ties as half."""
    names = list(dict.fromkeys(name for pair in pairs for name in (pair.first, pair.second)))
    shares = np.full((len(names), len(names)), np.nan)
    for pair in pairs:
        one, other = names.index(pair.first), names.index(pair.second)
        shares[one, other] = (pair.first_chosen + pair.ties / 2) / pair.n
        shares[other, one] = 1 - shares[one, other]
    size = len(names)
    with mpl.rc_context(STYLE):
        figure = new_figure(7.2, 2.0 + 0.34 * size)
        axes = figure.add_subplot()
        # Fixed ends put the pale middle of the color map at 0.5, no preference.
        drawn = axes.imshow(shares, cmap="PuOr", vmin=0, vmax=1)
        axes.set_xticks(range(size), names, rotation=30, ha="right")
        axes.set_yticks(range(size), names)
        axes.set_xlabel("over")
        axes.set_ylabel("chosen")
        for (row, column), share in np.ndenumerate(shares):
            if np.isfinite(share) and size <= NUMBERED_MAX:
                # Both ends of the color map are dark.
                ink = "white" if abs(share - 0.5) > 0.3 else "black"
                axes.text(column, row, f"{share:.2f}", ha="center", va="center", fontsize=8, color=ink)
        axes.spines[:].set_visible(False)
        figure.colorbar(drawn, ax=axes, label="share chosen")
        write_note(figure, f"N = {people}. A tie counts as half a choice for each.", synthetic, "comparisons")
        alt = "Proportion of comparisons in which the row's cell was chosen over the column's cell"
        return Picture(
            "figure-choices",
            "Choices in each pair",
            alt,
            *in_both_formats(figure),
        )


# Figures of continuous ratings: one panel per cell with its blinks marked, and the correlation by lag.

TRACE_COLUMNS = 2
PANEL_INCHES = 1.9
MARKS_SHARE = 0.12
"""Height of the marks of blinks below the ratings, as a share of theirs."""


def traces_figure(
    traces: Sequence[MeanTrace], labels: Sequence[str], earlier_s: float, synthetic: bool
) -> Picture:
    """One panel per cell: mean and interval, drawn `earlier_s` earlier; one row of marks per clip."""
    columns = min(TRACE_COLUMNS, len(traces))
    rows = -(-len(traces) // columns)
    figure = new_figure(height=PANEL_INCHES * rows + 0.9)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    low, high = _extent(traces)
    for panel, trace, label, colour in zip(panels, traces, labels, _colours(traces), strict=False):
        times = trace.times_s - earlier_s
        panel.plot(times, trace.mean, color=colour)
        panel.fill_between(times, trace.ci_low, trace.ci_high, color=colour, alpha=0.2, linewidth=0)
        _mark_events(panel, trace, low, MARKS_SHARE * (high - low))
        panel.set_title(label, fontsize=9)
    for panel in panels[len(traces) :]:
        panel.set_visible(False)
    panels[0].set_ylim(low - (MARKS_SHARE + 0.04) * (high - low), high)
    for panel in panels[::columns]:
        panel.set_ylabel("Rating")
    # Shared axes label the lowest row only; above an empty place the panel needs labels, too.
    for panel in panels[max(0, len(traces) - columns) : len(traces)]:
        panel.set_xlabel("Time in the clip in s" + (", less the lag" if earlier_s else ""))
        panel.tick_params(labelbottom=True)
    marked = any(events for trace in traces for events in trace.events_s)
    note = "Mean over people" if any(trace.people > 1 for trace in traces) else "Mean of one person's clips"
    note += " with 95% intervals" if any(np.isfinite(trace.ci_low).any() for trace in traces) else ""
    note += f", drawn {fixed(earlier_s)} s earlier than recorded." if earlier_s else "."
    note += " Marks: blinks, one row per clip." if marked else ""
    write_note(figure, note, synthetic, "answers")
    alt = f"Mean rating over time in {len(traces)} cells{', with blinks marked' if marked else ''}"
    return _trace_picture(figure, "figure-traces", "Mean traces", alt)


def lag_figure(lag: LagResult, synthetic: bool) -> Picture:
    """Correlation of the ratings' change with blinks, by lag."""
    figure = new_figure(height=3.4)
    axes = figure.add_subplot()
    axes.plot(lag.lags_s, lag.mean, color=COLOURS[0])
    axes.fill_between(lag.lags_s, lag.ci_low, lag.ci_high, color=COLOURS[0], alpha=0.18, linewidth=0)
    axes.axvline(lag.lag_s, color=COLOURS[1], linewidth=0.8, linestyle=":")
    axes.axhline(0, color="#888888", linewidth=0.6)
    axes.set_xlabel("Time after a blink in s")
    axes.set_ylabel("Correlation with the rating's change")
    write_note(figure, f"N = {lag.people}. Dotted: the lag.", synthetic, "answers")
    alt = f"Correlation of ratings with blinks, greatest at {fixed(lag.lag_s)} s"
    return _trace_picture(figure, "figure-lag", "Lag", alt)


def _colours(traces: Sequence[MeanTrace]) -> list[str]:
    return [COLOURS[position % len(COLOURS)] for position in range(len(traces))]


def _extent(traces: Sequence[MeanTrace]) -> tuple[float, float]:
    """Lowest and highest value drawn; intervals of one person are not numbers, and not drawn."""
    values = [
        float(value)
        for trace in traces
        for curve in (trace.mean, trace.ci_low, trace.ci_high)
        for value in curve[np.isfinite(curve)]
    ]
    low, high = min(values), max(values)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _mark_events(panel: Any, trace: MeanTrace, below: float, height: float) -> None:
    clips = [events for events in trace.events_s if events]
    row = height / max(1, len(clips))
    for position, events in enumerate(clips):
        top = below - position * row
        panel.vlines(events, top - 0.7 * row, top, color="#444444", linewidth=0.9)


POINTS_MAX = 5000
"""More points hide one another; those drawn are evenly spread over the rows."""


def residuals_figure(checks: ResidualChecks, synthetic: bool) -> Picture:
    """Residuals over fitted values, their normal quantiles, and simulated ranks against a uniform."""
    figure = new_figure(width=9.0, height=3.4)
    fitted, residuals, scaled = (np.array(v) for v in (checks.fitted, checks.residuals, checks.scaled))
    shown = np.linspace(0, len(fitted) - 1, min(len(fitted), POINTS_MAX)).astype(int)
    over, normal, uniform = figure.subplots(1, 3)
    dots: dict[str, Any] = {"s": 6, "color": COLOURS[0], "alpha": 0.4, "linewidth": 0}
    over.scatter(fitted[shown], residuals[shown], **dots)
    # Bins of equal size: each mean rests on as many ratings.
    bins = np.array_split(np.argsort(fitted, kind="stable"), min(10, len(fitted)))
    means = [(fitted[rows].mean(), residuals[rows].mean()) for rows in bins]
    over.plot(*np.transpose(means), color=COLOURS[1])
    over.set(xlabel="Fitted value", ylabel="Standardized residual")
    # Hazen's plotting positions, (i - 0.5) / n.
    places = (np.arange(len(residuals)) + 0.5) / len(residuals)
    normal.scatter(special.ndtri(places)[shown], np.sort(residuals)[shown], **dots)
    normal.set(xlabel="Normal quantile", ylabel="Residual quantile")
    uniform.scatter(places[shown], np.sort(scaled)[shown], **dots)
    uniform.set(xlabel="Uniform quantile", ylabel="Rank among simulations")
    over.axhline(0, color="#888888", linewidth=0.6)
    for panel, at in ((normal, (0.0, 0.0)), (uniform, (0.5, 0.5))):
        panel.axline(at, slope=1, color=COLOURS[1])
    note = (
        "Line, left: means of tenths of the ratings; middle and right: where points lie if the model holds."
    )
    write_note(figure, note, synthetic)
    alt = "Residuals over fitted values, normal quantiles of residuals, and ranks among simulated ratings"
    return _trace_picture(figure, "figure-residuals", "Residuals", alt)


def _trace_picture(figure: Any, key: str, title: str, alt: str) -> Picture:
    return Picture(key, title, alt, *in_both_formats(figure))


# The figure of a multiverse: p of every effect under every choice of rules, over the rules applied.

SMALLEST_P = 1e-4
"""Smaller p are drawn here."""

MULTIVERSE_LEGEND, RULE_CHARACTERS = 26, 24
LINE_INCHES = 0.13
"""Height of a line of 7 points."""

MAX_EFFECTS = len(COLOURS)
"""If there are more effects, those with the smallest p as declared are drawn; the table has all."""


def multiverse_picture(analysis: Analysis, result: "Multiverse") -> Picture:
    """Draw p of the effects above a dot for each rule that was applied; choices ordered by people left."""
    order = sorted(result.universes, key=lambda u: (u.n_participants, u.n_ratings, u.applied), reverse=True)
    with mpl.rc_context(STYLE):
        p = np.array([universe.p_values for universe in order])
        drawn = _drawn(p[[universe.declared for universe in order]][0])
        names = [wrap_text(analysis.labels.effect(result.effects[i]), MULTIVERSE_LEGEND) for i in drawn]
        rules = [wrap_text(name.replace("_", " "), RULE_CHARACTERS) for name in result.rules]
        # as high as the lines of the legend, and of the names of rules, need
        above = max(2.4, LINE_INCHES * 1.25 * sum(_lines(name) for name in names) + 0.3)
        below = max(0.4, sum(LINE_INCHES * _lines(rule) + 0.1 for rule in rules))
        figure = new_figure(7.2, above + below + 0.8)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[above, below])
        _tests(upper, p[:, drawn], names)
        _rules(lower, np.array([universe.applied for universe in order]), rules)
        declared = next(at for at, universe in enumerate(order) if universe.declared)
        for axes in (upper, lower):
            axes.axvline(declared, color="#999999", linewidth=5, alpha=0.25, zorder=0)
        # N is the first key of the order, so the ends have the extremes.
        low, high = order[-1].n_participants, order[0].n_participants
        note = f"Each column is one choice of exclusion rules, N from {high} to {low}; shaded: as declared."
        if len(drawn) < p.shape[1]:
            note += f" The {len(drawn)} effects of {p.shape[1]} with the smallest p as declared."
        write_note(figure, note, analysis.synthetic)
    what = "the p value of every effect under each choice of the declared exclusion rules"
    return Picture(
        "figure-multiverse",
        "Multiverse of exclusions",
        what,
        *in_both_formats(figure),
    )


def _drawn(p_declared: np.ndarray) -> list[int]:
    """Positions of the effects to draw, in the order of the table."""
    return sorted(np.argsort(p_declared, kind="stable")[:MAX_EFFECTS].tolist())


def _lines(text: str) -> int:
    return text.count("\n") + 1


def _tests(axes: Axes, p: np.ndarray, names: list[str]) -> None:
    columns = np.arange(len(p))
    for i, name in enumerate(names):
        axes.plot(
            columns,
            # On a logarithmic axis a p of 0 has no place.
            np.maximum(p[:, i], SMALLEST_P),
            color=COLOURS[i % len(COLOURS)],
            marker=MARKERS[i % len(MARKERS)],
            markersize=3.5,
            linewidth=0.6,
            label=name,
        )
    axes.axhline(SIGNIFICANCE, color="#555555", linewidth=0.8, linestyle="--")
    axes.set_yscale("log")
    axes.set_ylim(SMALLEST_P * 0.7, 1.3)
    ticks = [SMALLEST_P, 0.001, 0.01, SIGNIFICANCE, 0.1, 1]
    axes.set_yticks(ticks, ["≤ .0001", ".001", ".01", ".05", ".1", "1"])
    # Minor ticks of a logarithmic axis would add labels between those set above.
    axes.minorticks_off()
    axes.set_ylabel("p", style="italic")
    axes.legend(**BESIDE, frameon=False, fontsize=7)


def _rules(axes: Axes, applied: np.ndarray, names: list[str]) -> None:
    column, rule = np.nonzero(applied)
    axes.plot(column, rule, linestyle="none", marker="o", markersize=3.5, color="#333333")
    axes.set_yticks(range(len(names)), names, fontsize=7)
    # The first rule on top.
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)
