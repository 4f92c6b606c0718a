"""Thresholds over two stimulus variables as tables and words."""

from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, p_value
from analysis.report.threshold_tables import interval_text
from analysis.thresholds.people import Average
from analysis.thresholds.plane_people import PlanesResult


def plane_tables(
    result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool = False
) -> tuple[Table, ...]:
    """Parameters, the threshold along the second variable, and every person."""
    tables = [_parameters(result, variables, name, synthetic), _line(result, variables, name, synthetic)]
    return (*tables, _people(result, name, synthetic)) if result.people else tuple(tables)


def _parameters(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool) -> Table:
    rows = [
        (
            condition,
            fixed(fit.threshold, 3),
            interval_text(fit.threshold_ci),
            fixed(fit.tilt, 3),
            interval_text(fit.tilt_ci),
            fixed(fit.spread, 3),
            p_value(fit.p),
            str(fit.n_trials),
        )
        for condition, fit in result.pooled.items()
    ]
    for condition, means in result.means.items():
        if means.threshold is not None and means.tilt is not None:
            label = f"{condition}, mean of {means.threshold.people}"
            cells = (*_average(means.threshold), *_average(means.tilt))
            rows.append((label, *cells, DASH, DASH, DASH))
    header = ("Condition", "Threshold", "95% CI", "Tilt", "95% CI", "Spread", "fit p", "Trials")
    middle = next(iter(result.pooled.values())).middle
    notes = (
        f"Threshold: in {variables[0]}, where {variables[1]} is {middle:g}. "
        f"Tilt: change of the threshold per unit of {variables[1]}.",
    )
    title = caption("Thresholds over two variables", name, synthetic)
    return Table("thresholds", title, header, tuple(rows), 1, notes)


def _average(one: Average) -> tuple[str, str]:
    return fixed(one.mean, 3), f"{fixed(one.ci_low, 3)} to {fixed(one.ci_high, 3)}"


def _line(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool) -> Table:
    rows = tuple(
        (condition, f"{point.z:g}", fixed(point.threshold, 3), interval_text(point.ci))
        for condition, fit in result.pooled.items()
        for point in fit.line
    )
    title = caption(f"Threshold along {variables[1]}", name, synthetic)
    return Table("threshold-line", title, ("Condition", variables[1], "Threshold", "95% CI"), rows, 2)


def _people(result: PlanesResult, name: str, synthetic: bool) -> Table:
    rows = tuple(
        (one.participant, one.condition, one.reason, "", "", "")
        if one.fit is None
        else (
            one.participant,
            one.condition,
            fixed(one.fit.threshold, 3),
            interval_text(one.fit.threshold_ci),
            fixed(one.fit.tilt, 3),
            interval_text(one.fit.tilt_ci),
        )
        for one in result.people
    )
    title = caption("Thresholds by person", name, synthetic)
    header = ("Person", "Condition", "Threshold", "95% CI", "Tilt", "95% CI")
    return Table("threshold-people", title, header, rows, 2, (), True)


def plane_text(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool = False) -> str:
    """What was fitted, in words."""
    first = next(iter(result.pooled.values()))
    said = [
        f"{marked(name, synthetic)}: {first.shape} psychometric function of {variables[0]} whose threshold "
        f"is a straight line over {variables[1]}, guess rate {first.guess:g}, lapse rate {first.lapse:g}, "
        f"{result.n_trials} trials; profile likelihood intervals."
    ]
    said += [
        f"{condition}: no function was fitted, {reason}." for condition, reason in result.reasons.items()
    ]
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])
