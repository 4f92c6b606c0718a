"""The analysis of single-clip ratings: cell means, their tests, and additional models."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.plans.multiverse import MAX_RULES, Analyse, Multiverse, multiverse
from analysis.plans.plan import Plan, PlanRows, prepare, refuse_unknown, where
from analysis.plans.result import Analysis, analysis_of, labels_of
from analysis.read.pool import Pool
from analysis.read.reading import NoRatingsError, Reading
from analysis.read.study_answers import StudyAnswers
from analysis.report.contents import Contents, Part, Progress, Section, caption, in_words
from analysis.report.formats import Table
from analysis.report.json_output import as_data, exclusions_data, left_out, study_data
from analysis.report.numbers import DASH, fixed, p_value, share
from analysis.report.within_contents import methods_of, part_of
from analysis.within.anova import AnovaResult, linear_anova
from analysis.within.between import BetweenDesign, between_design, no_groups
from analysis.within.cell_means import CellTable, cell_table
from analysis.within.simple_effects import SIGNIFICANCE
from experiments.declaration.clip_rating import clip_rating_of
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import RatedScale
from experiments.design import rated_levels
from experiments.errors import InputError
from experiments.kinds import scale_called, scales_of
from experiments.kinds.clip_rating import RATINGS
from table_files import counted

# Ratings of a study: cell means, their tests, and what is computed in addition.


def on_scale(experiment: Experiment, rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """The rows of one scale: all of them where the study has one."""
    if len(scales_of(experiment)) == 1:
        return rows
    if "scale" not in rows.columns:
        raise InputError(f"'{experiment.name}' has several scales; the data have no column 'scale'")
    return rows[(rows["scale"] == name).to_numpy()]


class CellTests(NamedTuple):
    """Cell means of prepared rows, and every effect."""

    cells: CellTable
    anova: AnovaResult


# Decision 0130: The paper's table shows the multivariate test.
def run_tests(prepared: PlanRows) -> CellTests:
    """Average and test, and no more: what each choice of a multiverse needs."""
    experiment, rows = prepared.experiment, prepared.rows
    factors = experiment.compared_factors
    levels = {f.name: rated_levels(experiment, f.name) for f in experiment.factors}
    within = [name for name in factors if not experiment.factor(name).between]
    cells = cell_table(rows, "participant", "response", within, levels)
    between = [name for name in factors if name not in within]
    groups = groups_of(rows, cells.participants, between, levels) if between else no_groups(len(cells.y))
    return CellTests(cells, linear_anova(cells.y, cells.factors, cells.levels, groups))


def analyse(prepared: PlanRows, rating: str = "response") -> Analysis:
    """Average and test; `rating` names what was rated."""
    experiment = prepared.experiment
    cells, anova = run_tests(prepared)
    return analysis_of(
        cells,
        anova,
        name=experiment.name,
        title=experiment.title,
        source=prepared.source,
        rating=rating,
        synthetic=prepared.synthetic,
        decisions=prepared.decisions,
        labels=labels_of(experiment),
        experiment=experiment,
        exclusions=prepared.exclusions,
    )


def further_sections(analysis: Analysis, prepared: PlanRows, progress: Progress) -> tuple[Section, ...]:
    """Sensitivity analyses and the multiverse of one scale: the one `prepared` names, or the only one."""
    from analysis.plans.sensitivity import sensitivity_sections

    sections = sensitivity_sections(analysis, progress)
    progress("multiverse of exclusions")
    return (*sections, multiverse_section(analysis, prepared, _tested_named))


def _tested_named(prepared: PlanRows) -> CellTests:
    """The tests of one scale: the named one, or the only one."""
    if prepared.scale is None:
        return run_tests(prepared)
    rows = on_scale(prepared.experiment, prepared.rows, prepared.scale)
    return run_tests(replace(prepared, exclusions=replace(prepared.exclusions, rows=rows)))


def groups_of(
    rows: pd.DataFrame,
    participants: Sequence[str],
    factors: Sequence[str],
    levels: Mapping[str, Sequence[str]],
) -> BetweenDesign:
    """The groups of these participants; InputError where one has rows of two."""
    codes = np.zeros((len(participants), len(factors)), np.int64)
    for column, name in enumerate(factors):
        level_of: dict[str, str] = {}
        pairs = rows[["participant", name]].astype(str).drop_duplicates()
        for participant, level in pairs.itertuples(index=False):
            if level_of.setdefault(participant, level) != level:
                raise InputError(
                    f"participant {participant} has ratings of '{level_of[participant]}' and '{level}', but "
                    f"'{name}' is declared between participants"
                )
        codes[:, column] = [levels[name].index(level_of[participant]) for participant in participants]
    return between_design(factors, [levels[name] for name in factors], codes)


READING = Reading(RATINGS, numbers=("response",), further=("exemplar",), beside=("scale", "not_applicable"))


def check(experiment: Experiment, rows: pd.DataFrame, source: str) -> None:
    """Refuse a rating off the declared scale, and an unknown level."""
    for scale in scales_of(experiment):
        _check_scale(scale, on_scale(experiment, rows, scale.name), source)
    for factor in experiment.factors:
        known = [level.name for level in factor.levels]
        refuse_unknown(rows, factor.name, known, f"level of '{factor.name}'", source)
        _refuse_unrated(rows, factor.name, set(known) - {*rated_levels(experiment, factor.name)}, source)


def _refuse_unrated(rows: pd.DataFrame, factor: str, unrated: set[str], source: str) -> None:
    """Refuse a rating of a clip that is only shown as a reference; a row without one says nothing."""
    off = rows[factor].isin(unrated).to_numpy() & rows["response"].notna().to_numpy()
    if off.any():
        at = int(np.argmax(off))
        raise InputError(
            f"{source}: {where(rows, at)}: a rating of the reference's level '{rows[factor].iloc[at]}' of "
            f"'{factor}', which is not rated; remove the row, or set rate_itself = true"
        )


def _check_scale(scale: RatedScale, rows: pd.DataFrame, source: str) -> None:
    given = rows["response"].to_numpy()
    steps = (given - scale.minimum) / scale.step
    # Within a tolerance, since steps such as 0.1 are not exact in binary.
    off = (given < scale.minimum) | (given > scale.maximum) | (np.abs(steps - np.round(steps)) > 1e-6)
    if off.any():  # an empty answer is off nothing: comparisons with NaN are false
        at = int(np.argmax(off))
        rating = "a whole rating" if scale.step == 1 else f"a rating in steps of {scale.step:g}"
        raise InputError(
            f"{source}: {where(rows, at)}: expected {rating} from {scale.minimum:g} to {scale.maximum:g}, "
            f"got {given[at]:g}"
        )


def analyse_study(experiment: Experiment, answers: StudyAnswers, pool: Pool = Pool()) -> Analysis:
    """Check, exclude by the declared rules, average, and test; raises as `prepare`."""
    return analyse(prepare(experiment, PLAN, answers, pool))


def contents(prepared: PlanRows) -> Contents:
    """What the report says."""
    reported = _ratings(prepared)
    if clip_rating_of(prepared.experiment).reference is None:
        return reported
    from analysis.plans.degradation import with_degradation

    return with_degradation(reported, prepared)


def _ratings(prepared: PlanRows) -> Contents:
    from analysis.report.within_contents import contents_of

    if prepared.scale is not None:
        named = scale_called(prepared.experiment, prepared.scale)
        rows = on_scale(prepared.experiment, prepared.rows, named.name)
        if rows.empty:
            raise NoRatingsError(f"{prepared.source} has no ratings on the scale {named.name} yet")
        prepared = replace(prepared, exclusions=replace(prepared.exclusions, rows=rows))
        said = f"the scale {named.name} alone, of {len(scales_of(prepared.experiment))}"
        analysis = analyse(replace(prepared, decisions=(*prepared.decisions, said)), named.name)
        return contents_of(analysis, partial(further_sections, analysis, prepared))
    if len(scales_of(prepared.experiment)) > 1:
        return contents_of_scales(prepared)
    analysis = analyse(prepared)
    return contents_of(analysis, partial(further_sections, analysis, prepared))


PLAN = Plan(READING, check, contents, keys=("scale",))


# Ratings on several scales: each is analyzed separately; Cronbach's alpha shows how far they agree.

METHODS = (
    "Each scale is analyzed separately, as answered. Cronbach's alpha treats scales as items and the "
    "participants' ratings of clips as cases; reverse-keyed scales are reversed. "
)


def contents_of_scales(prepared: PlanRows) -> Contents:
    """A part of the report for each scale, and one for all."""
    experiment = prepared.experiment
    scales = scales_of(experiment)
    analyses = [(scale, _of_scale(prepared, scale)) for scale in scales]
    alpha = cronbach_alpha(scale_cases(prepared, scales))
    people = prepared.rows["participant"].astype(str).nunique()
    parts = [_part(scale, analysis, replace(prepared, scale=scale.name)) for scale, analysis in analyses]
    return Contents(
        name=experiment.name,
        title=experiment.title,
        lead=f"{counted(people, 'participant')}, {len(scales)} scales",
        source=prepared.source,
        synthetic=prepared.synthetic,
        n_participants=people,
        left_out=left_out(prepared.exclusions),
        decisions=tuple(dict.fromkeys(said for _, one in analyses for said in one.decisions)),
        parts=(*parts, _reliability(alpha, len(scales), experiment.name, prepared.synthetic)),
        methods=METHODS + methods_of(analyses[0][1]),
        numbers={
            **study_data(prepared, people),
            "scales": [
                {"scale": scale.name, "reverse": scale.reverse, **as_data(one)} for scale, one in analyses
            ],
            "cronbach_alpha": alpha,
            "exclusions": exclusions_data(prepared.exclusions),
        },
        given="ratings",
    )


def _of_scale(prepared: PlanRows, scale: RatedScale) -> Analysis:
    rows = on_scale(prepared.experiment, prepared.rows, scale.name)
    return analyse(replace(prepared, exclusions=replace(prepared.exclusions, rows=rows)), scale.name)


def _part(scale: RatedScale, analysis: Analysis, prepared: PlanRows) -> Part:
    """The part of one scale; `prepared` names it."""
    title = f"{in_words(scale.name)}{' (reverse-keyed)' if scale.reverse else ''}"

    def more(progress: Progress) -> tuple[Section, ...]:
        return further_sections(analysis, prepared, lambda step: progress(f"{scale.name}: {step}"))

    return part_of(analysis, more, title).under(scale.name, title)


def scale_cases(prepared: PlanRows, scales: Sequence[RatedScale]) -> pd.DataFrame:
    """One row per rated trial, one column per scale, reverse-keyed ones reversed; only complete trials."""
    rows = prepared.rows
    keys = [name for name in ("run", "trial_index", "play") if name in rows.columns]
    # Tables of other programs have no number of a trial: the cell takes its place.
    if "trial_index" not in keys:
        keys = ["run", *prepared.experiment.factor_names]
    columns = {}
    for scale in scales:
        mine = rows[(rows["scale"] == scale.name).to_numpy()]
        given = mine.groupby(keys, observed=True)["response"].mean()
        columns[scale.name] = scale.minimum + scale.maximum - given if scale.reverse else given
    return pd.DataFrame(columns).dropna()


def cronbach_alpha(cases: pd.DataFrame) -> dict[str, Any] | None:
    """Alpha with its 95% interval (Feldt), by pingouin; None where a scale does not vary."""
    # pingouin takes seconds to import, which one scale need not pay
    from pingouin import cronbach_alpha as alpha_of

    if len(cases) < 3 or not (np.ptp(cases.to_numpy(dtype=float), axis=0) > 0).all():
        return None
    alpha, (low, high) = alpha_of(data=cases)
    return {"alpha": float(alpha), "ci_low": float(low), "ci_high": float(high), "n": len(cases)}


def _reliability(alpha: dict[str, Any] | None, scales: int, name: str, synthetic: bool) -> Part:
    row = ("all", str(scales), DASH, DASH, DASH)
    said = (
        "Cronbach's alpha is not defined: a scale does not vary, or too few trials have an answer on every "
        "scale."
    )
    if alpha is not None:
        bounds = f"[{fixed(alpha['ci_low'], 3)}, {fixed(alpha['ci_high'], 3)}]"
        row = ("all", str(scales), fixed(alpha["alpha"], 3), bounds, str(alpha["n"]))
        said = f"Cronbach's alpha of the {scales} scales was {fixed(alpha['alpha'])}, 95% CI {bounds}."
    header = ("Scales", "Items", "alpha", "95% CI", "Ratings")
    table = Table("reliability", caption("Reliability of the scales", name, synthetic), header, (row,), 1)
    return Part((table,), (said,), "Reliability")


# What the report says of the multiverse of exclusions.

MULTIVERSE = "Multiverse of exclusions"


def multiverse_section(analysis: Analysis, prepared: PlanRows, analyse: Analyse) -> Section:
    """The section of the report: how far the tests depend on the rules."""
    if not prepared.experiment.exclusions:
        return Section(MULTIVERSE, "The experiment declares no exclusion rule, so there is nothing to vary.")
    from analysis.plans.sensitivity import MAX_RATINGS

    if len(prepared.checked.rows) > MAX_RATINGS:
        said = f"{len(prepared.checked.rows):,} ratings exceed the limit of {MAX_RATINGS:,}."
        return Section(MULTIVERSE, f"Not computed: {said}")
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    from analysis.report.figures import multiverse_picture

    result = multiverse(prepared, analyse)
    choices = "every choice among" if len(result.rules) <= MAX_RULES else "leaving out one or all of"
    text = (
        f"The tests under {choices} the {len(result.rules)} declared exclusion rules: "
        f"{len(result.universes)} analyses. Manual exclusions always apply."
    )
    if result.n_failed:
        text += f" {result.n_failed} other choices could not be analyzed."
    picture = multiverse_picture(analysis, result)
    return Section(MULTIVERSE, text, (_table(analysis, result),), (picture,))


def _table(analysis: Analysis, result: Multiverse) -> Table:
    p = np.array([universe.p_values for universe in result.universes])
    sizes = np.array([universe.sizes for universe in result.universes])
    declared = next(universe for universe in result.universes if universe.declared)
    rows = tuple(
        (
            analysis.labels.effect(factors),
            p_value(declared.p_values[i]),
            _range([p_value(value) for value in _ends(p[:, i])]),
            f"{int((p[:, i] < SIGNIFICANCE).sum())} of {len(p)}",
            _range([share(value) for value in _ends(sizes[:, i])]),
        )
        for i, factors in enumerate(result.effects)
    )
    kind = (
        ("Multivariate tests.")
        if analysis.multivariate_first
        else "p with the Greenhouse-Geisser correction."
    )
    people = [universe.n_participants for universe in result.universes]
    header = ("Effect", "p as declared", "p", f"significant at {share(SIGNIFICANCE, 2)}", "partial η²")
    notes = (f"N = {_range([str(min(people)), str(max(people))])}. {kind}",)
    title = caption("Tests under other exclusions", analysis.name, analysis.synthetic)
    return Table("multiverse", title, header, rows, 1, notes)


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    """Smallest and largest of the values there are; NaN where there is none."""
    given = values[np.isfinite(values)]
    return (float(given.min()), float(given.max())) if given.size else (np.nan, np.nan)


def _range(ends: list[str]) -> str:
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"
