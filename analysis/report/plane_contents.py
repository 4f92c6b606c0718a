"""The report of a study of thresholds over two factors: tables, sentences, and the lines of thresholds."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.plans.plan import PlanRows
from analysis.report.choice_tables import interval_text, plane_decimals, plane_tables
from analysis.report.contents import Contents, Part, Picture, caption
from analysis.report.formats import Table
from analysis.report.json_output import exclusions_data, left_out, study_data
from analysis.report.numbers import fixed, share
from analysis.report.threshold_contents import ADAPTIVE, compared_by, difference_sentence, differences_table
from analysis.thresholds.plane_people import PlanesResult
from experiments.declaration.threshold import threshold_of
from table_files import counted

if TYPE_CHECKING:
    from analysis.thresholds.plane_people import SeriesPlane
    from analysis.thresholds.series import Difference

METHODS = (
    "P(x, z) = guess + (1 - guess - lapse) F((x - t - b (z - z0)) / s), F the normal distribution function, "
    "x the {first}, z the {second}, with the declared guess rate {guess} and lapse rate {lapse}, by "
    "maximum likelihood: the threshold t at the middle z0 moves by the tilt b along z. Intervals are 95% "
    "profiles of the likelihood. 'fit p' tests the line and the shape against the proportions at every "
    "stimulus. {rest}"
)
POPULATION = (
    "Over people, thresholds and tilts are normal random variables. They are fitted to all "
    "responses by marginal maximum likelihood (profiles with the quantile of F(1, people - 1)). "
)
AVERAGES = "Means of individual fits are random-effects means (REML, Hartung-Knapp intervals). "


def contents_of(
    prepared: PlanRows, fits: "Sequence[SeriesPlane]", differences: "Sequence[Difference]"
) -> Contents:
    """What the report says."""
    experiment, trial = prepared.experiment, threshold_of(prepared.experiment)
    variables = _variables(prepared)
    people = prepared.rows["participant"].astype(str).nunique()
    tables = [_shares(fits, variables, experiment.name, prepared.synthetic)]
    if differences:
        # Results before the raw shares.
        tables.insert(0, differences_table(differences, experiment.name, prepared.synthetic))
    merged = merge(fits)
    if merged is not None:
        tables = [*plane_tables(merged, variables, experiment.name, prepared.synthetic), *tables]
    return Contents(
        name=experiment.name,
        title=experiment.title,
        lead=(
            f"{counted(people, 'participant')}, {counted(len(prepared.rows), 'trial')} in {len(fits)} series "
            f"of {' and '.join(variables)}"
        ),
        source=prepared.source,
        synthetic=prepared.synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=prepared.decisions,
        parts=(
            Part(
                tuple(tables),
                (*sentences(fits, variables), *map(difference_sentence, differences)),
                # A function, so that a report without figures never loads matplotlib.
                draw=lambda: (draw(fits, variables, prepared.synthetic, people),),
                # Two numbers per series: a brief report can have them all.
                brief=(*sentences(fits, variables), *map(difference_sentence, differences)),
            ),
        ),
        methods=METHODS.format(
            first=variables[0],
            second=variables[1],
            guess=f"{trial.task.guess:g}".replace("0.", ".", 1),
            lapse=f"{trial.lapse:g}".replace("0.", ".", 1),
            rest=(POPULATION if merged and merged.population else "")
            + (AVERAGES if merged and merged.means else "")
            + compared_by(differences)
            + ADAPTIVE,
        ),
        numbers=numbers(prepared, fits, differences, people),
    )


def _variables(prepared: PlanRows) -> tuple[str, str]:
    """Labels of the two factors."""
    first, second = (
        prepared.experiment.factor(name).label for name in threshold_of(prepared.experiment).stimulus.factors
    )
    return first, second


def merge(fits: "Sequence[SeriesPlane]") -> PlanesResult | None:
    """The fits of all series as one result, one condition per series; None where none was fitted."""
    done = [(fit.label, fit.result) for fit in fits if fit.result is not None]
    if not done:
        return None
    return PlanesResult(
        # "all" is the only condition of a series that is fitted by itself.
        {label: result.pooled["all"] for label, result in done},
        {fit.label: fit.reason for fit in fits if fit.reason},
        tuple(replace(one, condition=label) for label, result in done for one in result.people),
        {label: result.means["all"] for label, result in done},
        sum(result.n_trials for _, result in done),
        (),
        # Too few people give no population; their series are left out here alone.
        {label: result.population["all"] for label, result in done if result.population},
    )


def sentences(fits: "Sequence[SeriesPlane]", variables: tuple[str, str]) -> tuple[str, ...]:
    """The threshold and the tilt of each series."""
    said = [f"{fit.label}: no function was fitted: {fit.reason}." for fit in fits if fit.reason]
    for series in fits:
        if series.result is None:
            continue
        said.append(f"{series.label}: {_line_in_words(series.result, variables[1])}")
    return tuple(said)


def _line_in_words(result: PlanesResult, second: str) -> str:
    """Threshold and tilt with their intervals: of the population, or over all trials of fewer people."""
    pooled = result.pooled["all"]
    # The population generalizes; a pooled line is of these trials only.
    fit, of = (
        (result.population["all"], f"of {result.population['all'].people} people")
        if result.population
        else (pooled, "over all trials")
    )
    low, high = fit.tilt_ci.low, fit.tilt_ci.high
    at, by = plane_decimals(result)
    # A missing end is open: the likelihood does not bound it on this side.
    known = (low is not None and low > 0) or (high is not None and high < 0)
    verdict = f"so that it depends on {second}" if known else "an interval that includes 0"
    return (
        f"the threshold {of} was {fixed(fit.threshold, at)}, 95% CI {interval_text(fit.threshold_ci, at)}, "
        f"at {second} = {pooled.middle:g}. Its tilt, the change per unit of {second}, was "
        f"{fixed(fit.tilt, by)}, 95% CI {interval_text(fit.tilt_ci, by)}, {verdict}."
    )


def _shares(fits: "Sequence[SeriesPlane]", variables: tuple[str, str], name: str, synthetic: bool) -> Table:
    rows = tuple(
        (fit.label, f"{x:g}", f"{z:g}", f"{n:.0f}", f"{k:.0f}", share(k / n, 2))
        for fit in fits
        for x, z, n, k in zip(*fit.points, strict=True)
    )
    header = ("Series", *variables, "Trials", "Yes or correct", "Share")
    title = caption("Answers at each stimulus", name, synthetic)
    # A staircase visits many stimuli; a long table starts folded.
    return Table("threshold-shares", title, header, rows, 1, (), folded=len(rows) > 24)


def numbers(
    prepared: PlanRows, fits: "Sequence[SeriesPlane]", differences: "Sequence[Difference]", people: int
) -> dict[str, Any]:
    """The JSON document; conditions are the series' names."""
    names = {fit.label: fit.name for fit in fits}
    done = [(fit.name, fit.result) for fit in fits if fit.result is not None]
    return {
        **study_data(prepared, people),
        "n_trials": len(prepared.rows),
        "labels": {fit.name: fit.label for fit in fits},
        "pooled": {name: asdict(result.pooled["all"]) for name, result in done},
        "reasons": {fit.name: fit.reason for fit in fits if fit.reason},
        "people": [asdict(one) | {"condition": name} for name, result in done for one in result.people],
        "means": {name: asdict(result.means["all"]) for name, result in done},
        "population": {name: asdict(result.population["all"]) for name, result in done if result.population},
        "differences": [
            asdict(d) | {"first": names[d.first], "second": names[d.second]} for d in differences
        ],
        "decisions": list(prepared.decisions),
        "exclusions": exclusions_data(prepared.exclusions),
    }


def draw(fits: "Sequence[SeriesPlane]", variables: tuple[str, str], synthetic: bool, people: int) -> Picture:
    """One panel per series: shares at every stimulus, and the line of thresholds with its interval."""
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    import matplotlib as mpl

    from analysis.report.pictures import STYLE, in_both_formats, new_figure, write_note

    with mpl.rc_context(STYLE):
        figure = new_figure()
        # Panels share the first factor, so that lines can be compared across them.
        panels = figure.subplots(1, len(fits), sharey=True, squeeze=False)[0]
        for axes, fit in zip(panels, fits, strict=True):
            x, z, n, k = fit.points
            # A root, or stimuli with few trials would be too small to see.
            sizes = 12 + 80 * np.sqrt(n / n.max())
            # The threshold is a value of the first factor, hence upright, along the second.
            axes.scatter(
                z, x, s=sizes, c=k / n, cmap="cividis", vmin=0, vmax=1, edgecolor="0.4", linewidth=0.4
            )
            if fit.result is not None:
                line = fit.result.pooled["all"].line
                across = [point.z for point in line]
                axes.plot(across, [point.threshold for point in line], color="black", linewidth=1.3)
                ends = [(point.ci.low, point.ci.high) for point in line]
                known = [
                    (at, low, high)
                    for at, (low, high) in zip(across, ends, strict=True)
                    if low is not None and high is not None
                ]
                # A band needs two places.
                if len(known) > 1:
                    at, low, high = zip(*known, strict=True)
                    axes.fill_between(at, low, high, color="black", alpha=0.15, linewidth=0)
            axes.set_title(fit.label, fontsize=9)
            axes.set_xlabel(variables[1])
            # Large marks at the ends would be cut.
            axes.margins(x=0.15)
        panels[0].set_ylabel(variables[0])
        note = (
            f"N = {people}. Size: number of trials. Dark to light: proportion of yes (or correct), 0 to 1. "
            "Line: all trials."
        )
        write_note(figure, note, synthetic, "answers")
        alt = f"Thresholds of {len(fits)} series over {variables[0]} and {variables[1]}"
        made = in_both_formats(figure)
        return Picture("figure-thresholds", "Lines of thresholds", alt, *made)
