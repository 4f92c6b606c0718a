"""The report of a study of thresholds: tables, sentences and the psychometric functions."""

import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analysis.plans.plan import PlanRows
from analysis.report.choice_tables import (
    interval_text,
    means_table,
    people_table,
    threshold_decimals,
    threshold_table,
)
from analysis.report.contents import Contents, Part, Picture, caption
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data, left_out, study_data
from analysis.report.numbers import DASH, apa_p, decimals, fixed, interval, p_value, share
from analysis.report.r_models import threshold_files
from analysis.thresholds.likelihood import function
from analysis.thresholds.people import ThresholdsResult
from analysis.thresholds.psychometric import Threshold
from analysis.thresholds.series import answers_of
from experiments.declaration.threshold import threshold_of
from table_files import counted

if TYPE_CHECKING:
    from analysis.thresholds.series import Difference, SeriesFit

METHODS = (
    "P(x) = guess + (1 - guess - lapse) F(x), F {function}, with the declared guess rate {guess} and "
    "lapse rate {lapse}, by maximum likelihood; the threshold is where F is one half. Intervals are 95% "
    "profiles of the likelihood. {rest}"
)
AVERAGES = (
    "The first table averages the individual thresholds (random effects by REML, Hartung-Knapp interval). "
)
POOLED = "The table over all trials pools them, which flattens the slope if people differ. "
ADAPTIVE = "Stimuli depended on earlier responses; the likelihood is the same as for fixed stimuli. "
SIGNIFICANCE = 0.05
CRITERION = "where the function without guesses and lapses is one half"
WEIBULL = (
    "The declared Weibull function has its threshold where F = 1 - 1/e; here the threshold is where F = 1/2. "
)


def compared_by(differences: "Sequence[Difference]") -> str:
    """How series were compared; nothing where none were."""
    paired = [one.paired for one in differences]
    tests = ["within people by paired t tests"] * any(paired)
    tests += ["between groups by Welch's t tests"] * (not all(paired))
    if not tests:
        return ""
    most = max(one.left_out for one in differences)
    up_to = "up to " if any(one.left_out < most and not one.paired for one in differences) else ""
    without = f", without {up_to}{counted(most, 'participant')} who took part in both groups" if most else ""
    return f"Series are compared {' and '.join(tests)}{without}, Holm-corrected. "


def contents_of(
    prepared: PlanRows, fits: "Sequence[SeriesFit]", differences: "Sequence[Difference]"
) -> Contents:
    """What the report says."""
    experiment, trial = prepared.experiment, threshold_of(prepared.experiment)
    name, synthetic = experiment.name, prepared.synthetic
    people = prepared.rows["participant"].astype(str).nunique()
    # Tables and sentences are those of one study with conditions: a series is a condition here.
    merged, number = merge(fits), len(prepared.rows)
    axis = experiment.factor(trial.stimulus.factor).label
    return Contents(
        name=name,
        title=experiment.title,
        lead=f"{counted(people, 'participant')}, {counted(number, 'trial')} in {len(fits)} series of {axis}",
        source=prepared.source,
        synthetic=synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=prepared.decisions,
        parts=(
            Part(
                _tables(fits, merged, differences, name, synthetic),
                sentences(fits, merged, differences, axis),
                # A function, so that a report without figures never loads matplotlib.
                draw=lambda: (draw(fits, axis, synthetic, people),),
                beside=lambda key: _r_files(prepared, fits, differences, key),
                # Without the series that could not be fitted: those are in the full report.
                brief=sentences((), merged, differences, axis),
            ),
        ),
        methods=METHODS.format(
            function=trial.function,
            guess=f"{trial.task.guess:g}".replace("0.", ".", 1),
            lapse=f"{trial.lapse:g}".replace("0.", ".", 1),
            rest=(AVERAGES if merged.means else "")
            + (POOLED if people > 1 else "")
            + compared_by(differences)
            + ADAPTIVE
            + (WEIBULL if trial.function == "weibull" else ""),
        ),
        numbers=numbers(prepared, fits, merged, differences, people),
    )


def _r_files(
    prepared: PlanRows, fits: "Sequence[SeriesFit]", differences: "Sequence[Difference]", key: str
) -> dict[str, bytes]:
    """The script that fits every function again in R, and its trials."""
    return threshold_files(prepared.experiment.title, fits, answers_of(prepared), differences, key)


def merge(fits: "Sequence[SeriesFit]") -> ThresholdsResult:
    """The fits of all series as one result, one condition per series."""
    done = [(fit.label, fit.result) for fit in fits if fit.result is not None]
    return ThresholdsResult(
        # "all" is the only condition of a series that is fitted by itself.
        {label: result.pooled["all"] for label, result in done},
        tuple(replace(one, condition=label) for label, result in done for one in result.people),
        tuple(replace(mean, condition=label) for label, result in done for mean in result.means),
        sum(result.n_trials for _, result in done),
        (),
    )


def _tables(
    fits: "Sequence[SeriesFit]",
    merged: ThresholdsResult,
    differences: "Sequence[Difference]",
    name: str,
    synthetic: bool,
) -> tuple[Table, ...]:
    # Means over people first: they are the result; pooled fits flatten the slope.
    made = [means_table(merged, name, synthetic)] if merged.means else []
    if differences:
        made.append(differences_table(differences, name, synthetic))
    if merged.pooled:
        made.append(threshold_table(merged, name, synthetic))
    if merged.people:
        made.append(people_table(merged, name, synthetic))
    return (*made, shares_table(fits, name, synthetic))


def differences_table(differences: "Sequence[Difference]", name: str, synthetic: bool) -> Table:
    """Series compared within people."""
    # The standard error of each difference decides how many decimals all have.
    digits = decimals(abs(d.difference / d.t) if d.t else None for d in differences)
    rows = tuple(
        (
            # Thresholds are the default; only differences in something else are named.
            f"{d.first} - {d.second}" + ("" if d.what == "threshold" else f", {d.what}"),
            str(d.people),
            fixed(d.difference, digits),
            interval((d.ci_low, d.ci_high), digits),
            f"{fixed(d.t)} ({degrees(d.df)})",
            p_value(d.p_holm),
        )
        for d in differences
    )
    header = ("Series", "People", "Difference", "95% CI", "t (df)", "p (Holm)")
    title = caption("Differences of thresholds", name, synthetic)
    return Table("threshold-differences", title, header, rows, 1)


def degrees(df: float) -> str:
    """Degrees of freedom: whole, or with two decimals where Welch's test gave them."""
    return f"{df:.0f}" if float(df).is_integer() else f"{df:.2f}"


def shares_table(fits: "Sequence[SeriesFit]", name: str, synthetic: bool) -> Table:
    """Trials and answers at each stimulus."""
    rows = tuple(
        (fit.label, f"{x:g}", f"{n:.0f}", f"{k:.0f}", share(k / n, 2))
        for fit in fits
        for x, n, k in zip(fit.trials.x, fit.trials.n, fit.trials.k, strict=True)
    )
    header = ("Series", "Stimulus", "Trials", "Yes or correct", "Share")
    title = caption("Answers at each stimulus", name, synthetic)
    # A staircase visits many stimuli; a long table starts folded.
    return Table("threshold-shares", title, header, rows, 1, (), folded=len(rows) > 24)


def sentences(
    fits: "Sequence[SeriesFit]", merged: ThresholdsResult, differences: "Sequence[Difference]", along: str
) -> tuple[str, ...]:
    """The threshold of each series, over people where there are several, and the differences.

    `along` is the label of the stimulus with its unit.
    """
    # A label names its unit last; without one it is printed whole.
    named = re.search(r" in (\S{1,6})$| \((\S{1,6})\)$", along)
    unit = f" {named[1] or named[2]}" if named else f" ({along})"
    said = [f"{fit.label}: no function was fitted: {fit.reason}." for fit in fits if fit.reason]
    means, digits = {mean.condition: mean for mean in merged.means}, threshold_decimals(merged)
    for label, fit in merged.pooled.items():
        # A mean exists only where several people have a threshold.
        if label in means:
            mean = means[label]
            bounds = interval((mean.ci_low, mean.ci_high), digits)
            # Without a standard error there is no interval.
            sure = "the same for all of them" if bounds == DASH else f"95% CI {bounds}"
            said.append(
                f"{label}: the mean threshold of {mean.people} people ({CRITERION}) was "
                f"{fixed(mean.mean, digits)}{unit}, {sure}."
            )
        else:
            said.append(
                f"{label}: the threshold over all trials ({CRITERION}) was "
                f"{fixed(fit.threshold, digits)}{unit}, 95% CI {interval_text(fit.threshold_ci, digits)}."
            )
        said += [f"{label}: {note}." for note in fit.notes]
    return (*said, *(difference_sentence(one) for one in differences))


def difference_sentence(d: "Difference") -> str:
    """What a comparison of two series says."""
    verdict = "differed" if d.p_holm < SIGNIFICANCE else "did not differ significantly"
    # The brackets follow a p, so only the number is repeated.
    corrected = apa_p(d.p_holm).removeprefix("p ").removeprefix("= ")
    return (
        f"{d.what.capitalize()}s {verdict} between {d.first} and {d.second}, "
        f"t({degrees(d.df)}) = {fixed(d.t)}, {apa_p(d.p)} ({corrected} after Holm's correction)."
    )


def numbers(
    prepared: PlanRows,
    fits: "Sequence[SeriesFit]",
    merged: ThresholdsResult,
    differences: "Sequence[Difference]",
    people: int,
) -> dict[str, Any]:
    """The JSON document; conditions are the series' names."""
    # Labels may be translated and change; names in the JSON do not.
    names = {fit.label: fit.name for fit in fits}
    return {
        **study_data(prepared, people),
        "n_trials": len(prepared.rows),
        "labels": {fit.name: fit.label for fit in fits},
        "pooled": {names[label]: asdict(fit) for label, fit in merged.pooled.items()},
        "reasons": {fit.name: fit.reason for fit in fits if fit.reason},
        "people": [asdict(one) | {"condition": names[one.condition]} for one in merged.people],
        "means": [asdict(mean) | {"condition": names[mean.condition]} for mean in merged.means],
        "differences": [
            asdict(d) | {"first": names[d.first], "second": names[d.second]} for d in differences
        ],
        "decisions": list(prepared.decisions),
        "exclusions": exclusions_data(prepared.exclusions),
    }


def curve(fit: Threshold, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of positive answers at each x by the fitted function."""
    # The spread is fitted as a logarithm, which keeps it above 0.
    rise = function(fit.shape, x, fit.threshold, float(np.log(fit.spread)))
    # Where answers fall along the stimulus the function is mirrored; guess and lapse stay.
    share: NDArray[np.float64] = fit.guess + (1 - fit.guess - fit.lapse) * (1 - rise if fit.falling else rise)
    return share


def draw(fits: "Sequence[SeriesFit]", along: str, synthetic: bool, people: int) -> Picture:
    """Share of answers by stimulus, its size their number, and the fitted functions over all people."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    import matplotlib as mpl

    from analysis.report.pictures import (
        BESIDE,
        COLOURS,
        MARKERS,
        STYLE,
        in_both_formats,
        new_figure,
        write_note,
    )

    with mpl.rc_context(STYLE):
        figure = new_figure()
        axes = figure.add_subplot()
        for position, fit in enumerate(fits):
            colour, trials = COLOURS[position % len(COLOURS)], fit.trials
            # A root, or stimuli with few trials would be too small to see.
            sizes = 8 + 60 * np.sqrt(trials.n / max(1.0, float(trials.n.max())))
            marker = MARKERS[position % len(MARKERS)]
            shares = trials.k / trials.n
            axes.scatter(trials.x, shares, s=sizes, color=colour, marker=marker, alpha=0.6, label=fit.label)
            if fit.result is not None:
                of_all = fit.result.pooled["all"]
                # Only over the stimuli shown: beyond them the function is a guess.
                x = np.linspace(float(trials.x.min()), float(trials.x.max()), 200)
                axes.plot(x, curve(of_all, x), color=colour, linewidth=1.3)
                axes.axvline(of_all.threshold, color=colour, linewidth=0.8, linestyle=":")
        axes.set_ylim(-0.03, 1.03)
        axes.set_xlabel(along)
        axes.set_ylabel("Proportion of yes (or correct)")
        axes.grid(linewidth=0.4, alpha=0.5)
        axes.set_axisbelow(True)
        axes.legend(frameon=False, fontsize=8, **BESIDE)
        note = f"N = {people}. Size: number of trials. Dotted: threshold over all trials."
        write_note(figure, note, synthetic, "answers")
        alt = f"Psychometric functions of {len(fits)} series along {along}"
        made = in_both_formats(figure)
        return Picture("figure-thresholds", "Psychometric functions", alt, *made)
