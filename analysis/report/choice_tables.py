"""Paired comparisons and thresholds as tables and words."""

from collections import Counter
from collections.abc import Iterable, Sequence
from math import isnan

from analysis.pairs.abilities import Contrast, PairsResult
from analysis.pairs.intervals import QuestionPair
from analysis.pairs.jod_and_elo import EloResult, JodResult
from analysis.report.contents import caption, mark_name
from analysis.report.formats import Table
from analysis.report.numbers import DASH, apa_p, decimals, fixed, interval, p_value, share
from analysis.thresholds.likelihood import Interval
from analysis.thresholds.people import Average, PersonThreshold, ThresholdsResult
from analysis.thresholds.plane import Plane
from analysis.thresholds.plane_people import PersonPlane, PlanesResult, PopulationPlane
from analysis.thresholds.psychometric import FALLS

# Paired comparisons as tables and words.

INTERVALS: dict[str, tuple[str, ...]] = {
    "wald": (),
    "profile": ("Intervals: profile likelihood.",),
    "bootstrap": ("Intervals: percentiles of raters (or comparisons) drawn with replacement.",),
    "anytime": (
        "Intervals hold at every look together, for all differences of items (asymptotic confidence "
        "sequence, Waudby-Smith et al. 2024). In parentheses: the ranks that they leave open.",
    ),
}


def abilities_table(result: PairsResult, name: str, synthetic: bool = False) -> Table:
    """Items from the ablest down, against the reference."""
    robust = any(item.se_robust is not None for item in result.items)
    is_watched = any(item.rank_low is not None for item in result.items)
    header = ["Item", "Rank", "Ability", "SE", *(["robust SE"] if robust else []), "95% CI", "p", "W/L/T"]
    rows = []
    for item in sorted(result.items, key=lambda one: (one.rank, one.name)):
        errors = [item.se, *([item.se_robust] if item.se_robust is not None else [])]
        rank = f"{item.rank} ({item.rank_low}-{item.rank_high})" if is_watched else str(item.rank)
        row = [item.name, rank, fixed(item.ability, 3), *(fixed(error, 3) for error in errors)]
        is_reference = item.name == result.reference
        row += [DASH if is_reference else interval((item.ci_low, item.ci_high)), p_value(item.p)]
        rows.append((*row, f"{item.wins}/{item.losses}/{item.ties}"))
    said = f"Abilities in {result.scale}; '{result.reference}' is fixed at 0. W/L/T: won, lost, tied."
    if robust and result.intervals == "wald":
        said += " CI and p use the model's SE; robust p values are in the table of differences."
    notes = (said, *INTERVALS[result.intervals])
    title = caption("Abilities", name, synthetic)
    return Table("abilities", title, tuple(header), tuple(rows), 1, notes)


def contrasts_table(result: PairsResult, name: str, synthetic: bool = False) -> Table:
    """Every pair of items, Holm-corrected: by the model's errors, and by those that count raters."""
    robust = any(c.se_robust is not None for c in result.contrasts)
    is_special = result.intervals != "wald"
    has_bounds = any(c.p_equivalence is not None for c in result.contrasts)
    rows = tuple(
        (
            f"{c.first} - {c.second}",
            fixed(c.difference, 3),
            *((interval((c.ci_low, c.ci_high)),) if is_special else (fixed(c.se, 3), fixed(c.z))),
            p_value(c.p_holm),
            *(_robust_cells(c) if robust else ()),
            *((DASH if c.p_equivalence is None else p_value(c.p_equivalence),) if has_bounds else ()),
        )
        for c in result.contrasts
    )
    title = caption("Differences between items", name, synthetic)
    errors = ("95% CI",) if is_special else ("SE", "z")
    header = ("Items", "Difference", *errors, "p", *(("robust SE", "t", "robust p") if robust else ()))
    header = (*header, *(("p (TOST)",) if has_bounds else ()))
    return Table("pair-contrasts", title, header, rows, 1, (_which_errors(result, robust),), True)


def _robust_cells(contrast: Contrast) -> tuple[str, str, str]:
    se, p = contrast.se_robust, contrast.p_robust_holm
    if se is None or p is None:
        return "" if se is None else fixed(se, 3), DASH, DASH
    return fixed(se, 3), fixed(contrast.difference / se), p_value(p)


def _which_errors(result: PairsResult, robust: bool) -> str:
    """Which errors the p of the contrasts go by, and which to read."""
    if result.random_effects:
        return "SE, z and p allow for the crossed effects. p is Holm-corrected."
    if not robust:
        return (
            "SE, z and p assume that every comparison is from a different rater. Name the column of raters "
            "to add robust errors. p is Holm-corrected."
        )
    return (
        "SE, z and p assume that every comparison is from a different rater. Robust: raters as clusters, t "
        f"on {(result.n_participants or 1) - 1} df. Report the robust p if raters gave several comparisons. "
        "p is Holm-corrected."
    )


def effects_table(result: PairsResult, name: str, synthetic: bool = False) -> Table:
    """SDs of crossed effects, and the tests that they are zero."""
    rows = tuple(
        (effect.name, str(effect.levels), fixed(effect.sd, 3), fixed(effect.chi2), p_value(effect.p))
        for effect in result.random_effects
    )
    notes = ("SD of each item's ability between raters, contents or items. p is half that of χ²(1).",)
    title = caption("Crossed effects", name, synthetic)
    return Table("pair-effects", title, ("Differs by", "Levels", "SD", "χ²", "p"), rows, 1, notes)


def questions_table(compared: Sequence[QuestionPair], name: str, synthetic: bool = False) -> Table:
    """Whether questions rank the items alike, and each item's difference between two questions."""
    rows: list[tuple[str, ...]] = []
    for pair in compared:
        df = f"{pair.df}" if pair.df_error is None else f"{pair.df}, {pair.df_error:g}"
        test = DASH if pair.f_value is None or pair.p is None else f"F({df}) = {fixed(pair.f_value)}"
        p = DASH if pair.p is None else p_value(pair.p)
        rows.append((f"{pair.first} - {pair.second}", f"r = {fixed(pair.correlation)}", test, p))
        rows += [
            (f"  {one.item}", fixed(one.difference, 3), f"SE {fixed(one.se, 3)}", p_value(one.p_holm))
            for one in pair.differences
        ]
    notes = ("F: all abilities, against their mean, are the same for both questions. p of items: Holm.",)
    title = caption("Questions", name, synthetic)
    return Table("questions", title, ("Questions", "Difference", "Test", "p"), tuple(rows), 1, notes)


def elo_table(result: EloResult, name: str, synthetic: bool = False) -> Table:
    """Elo ratings from the highest down."""
    rows = tuple(
        (
            item.name,
            fixed(item.elo, 0),
            DASH
            if item.elo_low is None or item.elo_high is None
            else f"[{fixed(item.elo_low, 0)}, {fixed(item.elo_high, 0)}]",
            fixed(item.sd_order, 0),
            DASH if item.bradley_terry is None else fixed(item.bradley_terry, 0),
            f"{item.wins}/{item.losses}/{item.ties}",
        )
        for item in sorted(result.items, key=lambda one: -one.elo)
    )
    drawn = "comparisons" if result.n_participants is None else "raters"
    notes = (
        f"Elo: mean over {result.orders} random orders of the comparisons, K = {result.k_factor:g}. Order "
        f"SD: how much a single pass depends on the order. 95% CI: {result.samples} samples of {drawn}. "
        "Maximum likelihood: Bradley-Terry abilities on the same scale, without order.",
    )
    header = ("Item", "Elo", "95% CI", "Order SD", "Max. likelihood", "W/L/T")
    return Table("elo", caption("Elo ratings", name, synthetic), header, rows, 1, notes)


def elo_text(result: EloResult, name: str, synthetic: bool = False) -> str:
    """What was rated, and what to know about it."""
    said = (
        f"{mark_name(name, synthetic)}: Elo ratings, {result.n_comparisons} comparisons of "
        f"{len(result.items)} items."
    )
    return " ".join([said, *(f"{decision}." for decision in result.decisions)])


def factors_table(result: PairsResult, name: str, synthetic: bool = False) -> Table:
    """Likelihood-ratio tests of the factors, and their coefficients in treatment coding."""
    rows = []
    for test in result.factors:
        rows.append((test.factor, fixed(test.chi2, 3), str(test.df), p_value(test.p), ""))
        for level, estimate, se in zip(test.levels, test.estimates, test.standard_errors, strict=True):
            rows.append(
                (f"  {level} - {test.reference}", "", "", "", f"{fixed(estimate, 3)} ({fixed(se, 3)})")
            )
    title = caption("Factors of the items", name, synthetic)
    return Table("pair-factors", title, ("Factor", "χ²", "df", "p", "b (SE)"), tuple(rows), 1)


def pairs_text(result: PairsResult, name: str, synthetic: bool = False) -> str:
    """What was fitted and how well it holds, in words."""
    people = "" if result.n_participants is None else f" by {result.n_participants} raters"
    said = [
        f"{mark_name(name, synthetic)}: {result.method}{' with Firth penalty' if result.firth else ''}, "
        f"{result.n_comparisons} comparisons of {len(result.items)} items{people}, {result.n_ties} ties."
    ]
    fit = result.goodness
    if fit.df > 0:
        said.append(f"Fit of the pairs: G2({fit.df}) = {fixed(fit.deviance)}, {apa_p(fit.p)}.")
    if result.order_effect is not None:
        advantage = result.order_effect
        said.append(f"Advantage of the left side: {fixed(advantage.estimate)}, {apa_p(advantage.p)}.")
    if result.tie_probability_max is not None:
        said.append(f"Two equal items tie with probability {fixed(result.tie_probability_max)}.")
    triples = result.transitivity
    if triples.triples:
        said.append(f"{triples.weak_violations} of {triples.triples} triples violated weak transitivity.")
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])


# Scores in JOD as tables and words.

SCREENED = (
    "Likelihood: mean log10 probability of an observer's answers if the others' scores hold. Distance: "
    "interquartile ranges below the first quartile; look at observers above 1.5. Nobody was excluded."
)


def jod_tables(result: JodResult, name: str, synthetic: bool = False) -> tuple[Table, ...]:
    """Scores of every content, and the observers where they were screened."""
    several = len(result.scales) > 1
    intervals = any(item.jod_low is not None for scale in result.scales for item in scale.items)
    rows = tuple(
        (
            *((scale.content,) if several else ()),
            item.name,
            fixed(item.jod),
            *((interval((item.jod_low or 0.0, item.jod_high or 0.0)),) if intervals else ()),
            *((DASH if item.jod_plain is None else fixed(item.jod_plain),) if result.prior != "none" else ()),
            f"{item.wins}/{item.losses}",
        )
        for scale in result.scales
        for item in sorted(scale.items, key=lambda one: -one.jod)
    )
    header = (*(("Content",) if several else ()), "Item", "JOD", *(("95% CI",) if intervals else ()))
    header = (*header, *(("no prior",) if result.prior != "none" else ()), "W/L")
    notes = [f"1 JOD: 75% prefer the better item. Prior: {result.prior}."]
    if intervals:
        notes.append(f"Intervals: {result.bootstrap} samples of raters.")
    scores = Table("jod", caption("Scores in JOD", name, synthetic), header, rows, 1 + several, tuple(notes))
    if not result.observers:
        return (scores,)
    observers = tuple(
        (
            one.name,
            str(one.n),
            DASH if one.log_likelihood is None else fixed(one.log_likelihood, 3),
            DASH if one.distance is None else fixed(one.distance),
        )
        for one in sorted(result.observers, key=lambda one: (-(one.distance or 0.0), one.name))
    )
    head = ("Observer", "Answers", "Likelihood", "Distance")
    return scores, Table("observers", caption("Observers", name, synthetic), head, observers, 1, (SCREENED,))


def jod_text(result: JodResult, name: str, synthetic: bool = False) -> str:
    """What was scaled, and what to know about it."""
    first = result.scales[0]
    contents = "" if len(result.scales) == 1 else f" of {len(result.scales)} contents"
    zero = "a mean of 0" if first.reference is None else f"{first.reference} = {result.reference_jod:g}"
    number = sum(scale.n_comparisons for scale in result.scales if scale.content != "all")
    said = [
        f"{mark_name(name, synthetic)}: Thurstone's case V in JOD{contents}, {zero}, "
        f"{number or first.n_comparisons} comparisons."
    ]
    if far := [one.name for one in result.observers if one.is_far]:
        said.append(f"Unlike the other observers: {', '.join(far)}.")
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])


# Thresholds as tables and words.


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
            share(fit.lapse),
            p_value(fit.p),
            str(fit.n_trials),
        )
        for condition, fit in result.pooled.items()
    )
    header = ("Condition", "Threshold", "95% CI", "Spread", "x .75", "Lapse", "fit p", "Trials")
    first = next(iter(result.pooled.values()))
    notes = (
        f"Spread: {SPREADS[first.shape]}. x .75: where the whole function is .75. Lapse: "
        f"{'fitted' if first.lapse_fitted else 'assumed'} share of responses independent of the stimulus. "
        "fit p: test of the function against the proportions at every stimulus.",
        *(
            ("All trials pooled: if people differ, the slope is flatter and the interval is too narrow.",)
            if result.means
            else ()
        ),
    )
    title = caption("Thresholds over all trials", name, synthetic)
    return Table("thresholds", title, header, rows, 1, notes)


SPREADS: dict[str, str] = {
    "normal": "SD of the normal function",
    "logistic": "scale of the logistic function",
    "weibull": "exponent of the Weibull function",
}


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
        "Mean of the individual thresholds, weighted by their errors (random effects by REML, "
        "Hartung-Knapp interval). SD: between-person standard deviation of thresholds.",
        *_same_threshold(result),
        *_without_threshold(result),
    )
    title = caption("Thresholds, mean over people", name, synthetic)
    return Table("threshold-means", title, header, rows, 1, notes)


def _same_threshold(result: ThresholdsResult) -> list[str]:
    """Conditions whose people all have one threshold, which gives the mean no standard error."""
    return [
        f"{mean.condition}: all {mean.people} people have the same threshold, so the mean has no standard "
        "error. Their answers change at the same levels, whose distance limits the precision. Report the "
        "interval of single people, or show levels in between."
        for mean in result.means
        if isnan(mean.se)
    ]


def _without_threshold(result: ThresholdsResult) -> list[str]:
    """Sentences about people without a threshold: they are left out of the mean, which may be biased."""
    said = []
    for mean in result.means:
        everybody = [one.participant for one in result.people if one.condition == mean.condition]
        if lacking := len(everybody) - mean.people:
            said.append(
                f"{mean.condition}: {lacking} of {len(everybody)} people have no individual threshold and "
                "are not in the mean. The mean is biased if their thresholds are outside the levels shown. "
                "Add --hierarchical to include everybody."
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
    notes = (
        (
            "Threshold and log spread are normally distributed over people. The interval of the mean is a "
            "profile likelihood interval."
        ),
    )
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
        (one.participant, one.condition, *(cells or [DASH] * len(measures))) for one, cells in people
    )
    reasons = Counter(one.reason for one, cells in people if not cells)
    notes = tuple(f"{DASH} ({count} of {len(rows)} rows): {reason}." for reason, count in reasons.items())
    title = caption("Thresholds by person", name, synthetic)
    return Table("threshold-people", title, ("Person", "Condition", *measures), rows, 2, notes, True)


def threshold_text(result: ThresholdsResult, name: str, synthetic: bool = False) -> str:
    """What was fitted, in words."""
    first = next(iter(result.pooled.values()))
    lapse = "fitted lapse rate" if first.lapse_fitted else f"lapse rate {first.lapse:g}"
    said = [
        f"{mark_name(name, synthetic)}: {first.shape} psychometric function, guess rate "
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


# Thresholds over two stimulus variables as tables and words.


def plane_decimals(result: PlanesResult) -> tuple[int, int]:
    """Decimals of every threshold and of every tilt: what the narrowest interval supports."""
    fits: list[Plane | PopulationPlane] = [*result.pooled.values(), *result.population.values()]

    def of(intervals: Iterable[Interval]) -> int:
        # an interval of 95% is about four standard errors wide
        ends = [(one.low, one.high) for one in intervals]
        return decimals((high - low) / 4 for low, high in ends if low is not None and high is not None)

    return of(fit.threshold_ci for fit in fits), of(fit.tilt_ci for fit in fits)


def plane_tables(
    result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool = False
) -> tuple[Table, ...]:
    """Parameters, the threshold along the second variable, and every person."""
    tables = [_parameters(result, variables, name, synthetic), _line(result, variables, name, synthetic)]
    return (*tables, _people(result, name, synthetic)) if result.people else tuple(tables)


def _parameters(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool) -> Table:
    digits, tilt_digits = plane_decimals(result)
    rows = [
        (
            f"{condition}, {fit.people} people",
            *estimate(fit.threshold, fit.threshold_ci, digits),
            *estimate(fit.tilt, fit.tilt_ci, tilt_digits),
            fixed(fit.spread, digits),
            DASH,
            DASH,
        )
        for condition, fit in result.population.items()
    ]
    rows += [
        (
            f"{condition}, all trials" if result.people else condition,
            *estimate(fit.threshold, fit.threshold_ci, digits),
            *estimate(fit.tilt, fit.tilt_ci, tilt_digits),
            fixed(fit.spread, digits),
            p_value(fit.p),
            str(fit.n_trials),
        )
        for condition, fit in result.pooled.items()
    ]
    for condition, means in result.means.items():
        if means.threshold is not None and means.tilt is not None:
            label = f"{condition}, mean of {means.threshold.people} individual fits"
            cells = (*_average(means.threshold, digits), *_average(means.tilt, tilt_digits))
            rows.append((label, *cells, DASH, DASH, DASH))
    header = ("Condition", "Threshold", "95% CI", "Tilt", "95% CI", "Spread", "fit p", "Trials")
    middle = next(iter(result.pooled.values())).middle
    notes = (
        f"Threshold: {variables[0]} at {variables[1]} = {middle:g}. Tilt: change of the threshold per unit "
        f"of {variables[1]}.",
        *_of_people(result),
        # With a guess rate answers count as correct, and better answers at less of x may be a mistake.
        *(f"{condition}: {FALLS}." for condition, fit in result.pooled.items() if fit.guess and fit.falling),
        *(
            f"{condition}: all people have the same {name}, so the mean has no interval."
            for condition, means in result.means.items()
            for name, one in (("threshold", means.threshold), ("tilt", means.tilt))
            if one is not None and isnan(one.se)
        ),
    )
    title = caption("Thresholds over two variables", name, synthetic)
    return Table("thresholds", title, header, tuple(rows), 1, notes)


def _of_people(result: PlanesResult) -> tuple[str, ...]:
    """What the rows are of, and how people differ."""
    if not result.people:
        return ()
    digits, tilt_digits = plane_decimals(result)
    differ = [
        f"{condition}: {fixed(fit.threshold_sd, digits)} and {fixed(fit.tilt_sd, tilt_digits)}"
        for condition, fit in result.population.items()
    ]
    said = "All trials: treated as if from one person. The intervals are too narrow if people differ."
    return (said, f"SD between people of threshold and tilt: {'; '.join(differ)}.") if differ else (said,)


def _average(one: Average, digits: int) -> tuple[str, str]:
    return fixed(one.mean, digits), interval((one.ci_low, one.ci_high), digits)


def _line(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool) -> Table:
    rows = tuple(
        (condition, f"{point.z:g}", *estimate(point.threshold, point.ci, plane_decimals(result)[0]))
        for condition, fit in result.pooled.items()
        for point in fit.line
    )
    title = caption(f"Threshold along {variables[1]}", name, synthetic)
    return Table("threshold-line", title, ("Condition", variables[1], "Threshold", "95% CI"), rows, 2)


def _people(result: PlanesResult, name: str, synthetic: bool) -> Table:
    digits, tilt_digits = plane_decimals(result)
    rows = [
        (
            one,
            None
            if one.fit is None
            else (
                *estimate(one.fit.threshold, one.fit.threshold_ci, digits),
                *estimate(one.fit.tilt, one.fit.tilt_ci, tilt_digits),
            ),
        )
        for one in result.people
    ]
    return table_of_people(rows, ("Threshold", "95% CI", "Tilt", "95% CI"), name, synthetic)


def plane_text(result: PlanesResult, variables: tuple[str, str], name: str, synthetic: bool = False) -> str:
    """What was fitted, in words."""
    first = next(iter(result.pooled.values()))
    said = [
        f"{mark_name(name, synthetic)}: {first.shape} psychometric function of {variables[0]} whose "
        f"threshold varies linearly with {variables[1]}, guess rate {first.guess:g}, lapse rate "
        f"{first.lapse:g}, {result.n_trials} trials; profile likelihood intervals."
    ]
    said += [
        (f"{condition}: no function was fitted: {reason}.") for condition, reason in result.reasons.items()
    ]
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])
