"""Thresholds as tables and words."""

from collections.abc import Sequence

from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, decimals, fixed, interval, p_value
from analysis.thresholds.likelihood import Interval
from analysis.thresholds.people import PersonThreshold, ThresholdsResult
from analysis.thresholds.plane_people import PersonPlane


def threshold_decimals(result: ThresholdsResult) -> int:
    """Decimals of every threshold of a result: what the most certain of them supports."""
    return decimals(
        [
            *(fit.threshold_se for fit in result.pooled.values()),
            *(fit.threshold_se for fit in result.population.values()),
            *(mean.se for mean in result.means),
        ]
    )


def threshold_table(result: ThresholdsResult, name: str, synthetic: bool = False) -> Table:
    """The fit over all trials of each condition."""
    digits = threshold_decimals(result)
    rows = tuple(
        (
            condition,
            fixed(fit.threshold, digits),
            interval_text(fit.threshold_ci, digits),
            fixed(fit.spread, digits),
            DASH if fit.x75 is None else fixed(fit.x75, digits),
            fixed(fit.lapse, 3),
            p_value(fit.p),
            str(fit.n_trials),
        )
        for condition, fit in result.pooled.items()
    )
    header = ("Condition", "Threshold", "95% CI", "Spread", "x .75", "Lapse", "fit p", "Trials")
    notes = (
        ("All trials pooled: where people differ the slope is flatter and the interval too narrow.",)
        if result.means
        else ()
    )
    title = caption("Thresholds over all trials", name, synthetic)
    return Table("thresholds", title, header, rows, 1, notes)


def means_table(result: ThresholdsResult, name: str, synthetic: bool = False) -> Table:
    """Each condition's threshold as the mean of those of single people, which is the answer for people."""
    digits = threshold_decimals(result)
    rows = tuple(
        (
            mean.condition,
            str(mean.people),
            fixed(mean.mean, digits),
            fixed(mean.se, digits),
            interval((mean.ci_low, mean.ci_high), digits),
            fixed(mean.tau, digits),
        )
        for mean in result.means
    )
    header = ("Condition", "People", "Threshold", "SE", "95% CI", "SD")
    notes = (
        "Mean of the thresholds of single people, weighed by their errors (random effects by REML, Hartung "
        "and Knapp's interval). SD: how far people's own thresholds differ.",
        *_without_threshold(result),
    )
    title = caption("Thresholds, mean over people", name, synthetic)
    return Table("threshold-means", title, header, rows, 1, notes)


def _without_threshold(result: ThresholdsResult) -> list[str]:
    """Who is in no mean: it then is of people whose thresholds lie among what was shown, and may be off."""
    said = []
    for mean in result.means:
        everybody = [one.participant for one in result.people if one.condition == mean.condition]
        if lacking := len(everybody) - mean.people:
            said.append(
                f"{mean.condition}: {lacking} of {len(everybody)} people have no threshold of their own and "
                "are not in the mean, which is off where theirs lie outside the levels shown; "
                "--hierarchical counts everybody."
            )
    return said


def population_table(result: ThresholdsResult, name: str, synthetic: bool = False) -> Table:
    """The model over all people of each condition."""
    digits = threshold_decimals(result)
    rows = tuple(
        (
            condition,
            fixed(fit.threshold, digits),
            interval_text(fit.threshold_ci, digits),
            fixed(fit.threshold_sd, digits),
            fixed(fit.spread, digits),
            fixed(fit.log_spread_sd, 3),
            str(fit.people),
        )
        for condition, fit in result.population.items()
    )
    header = ("Condition", "Threshold", "95% CI", "SD", "Spread", "SD of log", "People")
    notes = ("Threshold and log spread are normal over people; profile likelihood interval of the mean.",)
    return Table("population", caption("Thresholds over people", name, synthetic), header, rows, 1, notes)


def people_table(result: ThresholdsResult, name: str, synthetic: bool = False) -> Table:
    """Every person's threshold."""
    digits = threshold_decimals(result)
    rows = [
        (
            one,
            None
            if one.fit is None
            else (*estimate(one.fit.threshold, one.fit.threshold_ci, digits), fixed(one.fit.spread, digits)),
        )
        for one in result.people
    ]
    return table_of_people(rows, ("Threshold", "95% CI", "Spread"), name, synthetic)


def estimate(value: float, interval: Interval, digits: int = 3) -> tuple[str, str]:
    """The cells of an estimate and its interval."""
    return fixed(value, digits), interval_text(interval, digits)


def table_of_people(
    people: Sequence[tuple[PersonThreshold | PersonPlane, tuple[str, ...] | None]],
    measures: tuple[str, ...],
    name: str,
    synthetic: bool,
) -> Table:
    """What was measured of every person in every condition, or why nothing could be."""
    rows = tuple(
        (one.participant, one.condition, *(cells or (one.reason, *[""] * (len(measures) - 1))))
        for one, cells in people
    )
    title = caption("Thresholds by person", name, synthetic)
    return Table("threshold-people", title, ("Person", "Condition", *measures), rows, 2, (), True)


def threshold_text(result: ThresholdsResult, name: str, synthetic: bool = False) -> str:
    """What was fitted, in words."""
    first = next(iter(result.pooled.values()))
    lapse = "fitted lapse rate" if first.lapse_fitted else f"lapse rate {first.lapse:g}"
    said = [
        f"{marked(name, synthetic)}: {first.shape} psychometric function, guess rate "
        f"{first.guess:g}, {lapse}, {result.n_trials} trials; profile likelihood intervals."
    ]
    for condition, fit in result.pooled.items():
        said += [f"{'' if condition == 'all' else condition + ': '}{note}." for note in fit.notes]
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])


def interval_text(interval: Interval, digits: int = 3) -> str:
    """Both ends; `open` where the likelihood never falls far enough."""
    low = "open" if interval.low is None else fixed(interval.low, digits)
    high = "open" if interval.high is None else fixed(interval.high, digits)
    return f"[{low}, {high}]"
