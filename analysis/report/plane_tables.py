"""Thresholds over two stimulus variables as tables and words."""

from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, interval, p_value
from analysis.report.threshold_tables import estimate, table_of_people
from analysis.thresholds.averages import Average
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
            f"{condition}, {fit.people} people",
            *estimate(fit.threshold, fit.threshold_ci),
            *estimate(fit.tilt, fit.tilt_ci),
            fixed(fit.spread, 3),
            DASH,
            DASH,
        )
        for condition, fit in result.population.items()
    ]
    rows += [
        (
            f"{condition}, all trials" if result.people else condition,
            *estimate(fit.threshold, fit.threshold_ci),
            *estimate(fit.tilt, fit.tilt_ci),
            fixed(fit.spread, 3),
            p_value(fit.p),
            str(fit.n_trials),
        )
        for condition, fit in result.pooled.items()
    ]
    for condition, means in result.means.items():
        if means.threshold is not None and means.tilt is not None:
            label = f"{condition}, mean of {means.threshold.people} own fits"
            cells = (*_average(means.threshold), *_average(means.tilt))
            rows.append((label, *cells, DASH, DASH, DASH))
    header = ("Condition", "Threshold", "95% CI", "Tilt", "95% CI", "Spread", "fit p", "Trials")
    middle = next(iter(result.pooled.values())).middle
    notes = (
        f"Threshold: in {variables[0]}, where {variables[1]} is {middle:g}. "
        f"Tilt: change of the threshold per unit of {variables[1]}.",
        *_of_people(result),
    )
    title = caption("Thresholds over two variables", name, synthetic)
    return Table("thresholds", title, header, tuple(rows), 1, notes)


def _of_people(result: PlanesResult) -> tuple[str, ...]:
    """What the rows are of, and how people differ."""
    if not result.people:
        return ()
    differ = [
        f"{condition}: {fixed(fit.threshold_sd, 3)} and {fixed(fit.tilt_sd, 3)}"
        for condition, fit in result.population.items()
    ]
    said = "All trials: as if one person had given them, too sure where people differ."
    return (said, f"SD between people of threshold and tilt: {'; '.join(differ)}.") if differ else (said,)


def _average(one: Average) -> tuple[str, str]:
    return fixed(one.mean, 3), interval((one.ci_low, one.ci_high), 3)


def _line(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool) -> Table:
    rows = tuple(
        (condition, f"{point.z:g}", *estimate(point.threshold, point.ci))
        for condition, fit in result.pooled.items()
        for point in fit.line
    )
    title = caption(f"Threshold along {variables[1]}", name, synthetic)
    return Table("threshold-line", title, ("Condition", variables[1], "Threshold", "95% CI"), rows, 2)


def _people(result: PlanesResult, name: str, synthetic: bool) -> Table:
    rows = [
        (
            one,
            None
            if one.fit is None
            else (
                *estimate(one.fit.threshold, one.fit.threshold_ci),
                *estimate(one.fit.tilt, one.fit.tilt_ci),
            ),
        )
        for one in result.people
    ]
    return table_of_people(rows, ("Threshold", "95% CI", "Tilt", "95% CI"), name, synthetic)


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
