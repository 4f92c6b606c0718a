"""Thresholds as tables and words."""

from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, p_value
from analysis.thresholds.likelihood import Interval
from analysis.thresholds.people import ThresholdsResult


def threshold_table(result: ThresholdsResult, name: str, synthetic: bool = False) -> Table:
    """The fit over all trials of each condition, and the mean over people where there is one."""
    rows = [
        (
            condition,
            fixed(fit.threshold, 3),
            interval_text(fit.threshold_ci),
            fixed(fit.spread, 3),
            DASH if fit.x75 is None else fixed(fit.x75, 3),
            fixed(fit.lapse, 3),
            p_value(fit.p),
            str(fit.n_trials),
        )
        for condition, fit in result.pooled.items()
    ]
    rows += [
        (
            f"{mean.condition}, mean of {mean.people}",
            fixed(mean.mean, 3),
            f"{fixed(mean.ci_low, 3)} to {fixed(mean.ci_high, 3)}",
            DASH,
            DASH,
            DASH,
            DASH,
            DASH,
        )
        for mean in result.means
    ]
    header = ("Condition", "Threshold", "95% CI", "Spread", "x .75", "Lapse", "fit p", "Trials")
    notes = (
        ("All trials pooled, so that differences between people flatten the slope.",) if result.means else ()
    )
    title = caption("Thresholds", name, synthetic)
    return Table("thresholds", title, header, tuple(rows), 1, notes)


def population_table(result: ThresholdsResult, name: str, synthetic: bool = False) -> Table:
    """The model over all people of each condition."""
    rows = tuple(
        (
            condition,
            fixed(fit.threshold, 3),
            interval_text(fit.threshold_ci),
            fixed(fit.threshold_sd, 3),
            fixed(fit.spread, 3),
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
    rows = tuple(
        (one.participant, one.condition, one.reason, "", "")
        if one.fit is None
        else (
            one.participant,
            one.condition,
            fixed(one.fit.threshold, 3),
            interval_text(one.fit.threshold_ci),
            fixed(one.fit.spread, 3),
        )
        for one in result.people
    )
    title = caption("Thresholds by person", name, synthetic)
    header = ("Person", "Condition", "Threshold", "95% CI", "Spread")
    return Table("threshold-people", title, header, rows, 2, (), True)


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


def interval_text(interval: Interval) -> str:
    """Both ends; `open` where the likelihood never falls far enough."""
    low = "open" if interval.low is None else fixed(interval.low, 3)
    high = "open" if interval.high is None else fixed(interval.high, 3)
    return f"{low} to {high}"
