"""Sensitivity analyses beside the ANOVA: Bayes factors, robust companions, mixed and ordinal models."""

from collections.abc import Callable
from functools import partial
from math import isfinite
from typing import Any

from analysis.plans.model_notes import notes_of
from analysis.plans.random_factors import fit_with_random, holds_for, said_of_random
from analysis.plans.result import Analysis
from analysis.report.captions import caption
from analysis.report.contents import Section
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, p_value
from analysis.report.r_models import model_files
from analysis.within.simple_effects import first_p
from experiments.errors import InputError

MAX_RATINGS = 50_000
"""Above this the models would keep the report waiting; the commands mixed and ordinal still fit them."""

MAX_CELLS = 16
"""Above this the models of the report have slopes for main effects only, as the report states."""


def sensitivity_sections(
    analysis: Analysis, progress: Callable[[str], None] = lambda _: None
) -> tuple[Section, ...]:
    """Every sensitivity analysis the data allow, as sections; what they do not allow says why."""
    progress("Bayes factors")
    sections = [bayes_factors(analysis), robust_companions(analysis, progress)]
    reason = _no_models(analysis)
    if reason is not None:
        return (*sections, Section("Mixed and ordinal models", f"Not fitted: {reason}."))
    for title, fit in (("Linear mixed model", mixed_model), ("Ordinal mixed model", ordinal_model)):
        progress(title)
        try:
            sections.append(fit(analysis))
        except InputError as error:
            sections.append(Section(title, f"Not fitted: {error}."))
    return tuple(sections)


def robust_companions(analysis: Analysis, progress: Callable[[str], None] = lambda _: None) -> Section:
    """Permutations, aligned ranks and trimmed means beside the ANOVA."""
    from analysis.report.robust_tables import robust_section
    from analysis.robust.companions import companions_of

    progress("robust companions")
    return robust_section(analysis, analysis.robust or companions_of(analysis.anova))


def _no_models(analysis: Analysis) -> str | None:
    if analysis.exclusions is None or analysis.experiment is None:
        return "no experiment is declared, so what was rated is unknown"
    rows = analysis.exclusions.rows
    if "exemplar" not in rows.columns or rows["exemplar"].isna().any():
        return "the data do not say which exemplar was rated"
    if len(rows) > MAX_RATINGS:
        return f"{len(rows)} ratings are more than {MAX_RATINGS}; use analysis mixed and analysis ordinal"
    return None


def _model_arguments(analysis: Analysis) -> dict[str, Any]:
    """Rows of the participants in the ANOVA, and the columns that name the blink shown."""
    if analysis.exclusions is None or analysis.experiment is None:
        raise InputError("models need a declared experiment")
    rows = analysis.exclusions.rows
    rows = rows[rows["participant"].isin(list(analysis.cells.participants)).to_numpy()]
    return {
        "rows": rows,
        "participant": "participant",
        "rating": "response",
        "within": list(analysis.anova.factors),
        "between": list(analysis.anova.between.factors),
        "item": [*analysis.experiment.exemplars.own_per, "exemplar"],
    }


def _random_factors(analysis: Analysis) -> list[str]:
    declared = analysis.experiment.factors if analysis.experiment is not None else ()
    return [factor.name for factor in declared if factor.random]


def mixed_model(analysis: Analysis) -> Section:
    """The linear mixed model's tests beside those of the ANOVA."""
    every = len(analysis.cells.cells) <= MAX_CELLS
    random = _random_factors(analysis)
    arguments = _model_arguments(analysis)
    result, random_slopes = fit_with_random(arguments, random, every)
    rows = []
    for effect in result.effects:
        ours = analysis.anova.effect(effect.effect)
        df = f"{effect.df_effect}, {fixed(effect.df_error, 1)}"
        cells = (
            fixed(effect.f_value, 3),
            df,
            p_value(effect.p_value),
            p_value(first_p(ours, analysis.multivariate_first)),
        )
        holds = (holds_for(effect.effect, random, random_slopes),) if random else ()
        rows.append((analysis.labels.effect(ours.factors), *cells, *holds))
    header = ("Effect", "F", "df", "p", "p of the ANOVA", *(("holds for",) if random else ()))
    notes = (f"Model: {result.formula}.", *notes_of(result, analysis.labels))
    table = Table(
        "mixed",
        caption("Linear mixed model", analysis.name, analysis.synthetic),
        header,
        tuple(rows),
        1,
        notes,
    )
    slopes = "every effect" if every else "the main effects"
    text = (
        f"Participants crossed with blinks, by-participant slopes for {slopes}, REML, type III tests with "
        f"Satterthwaite's df; {result.n_ratings} ratings of {result.n_items} blinks by "
        f"{result.n_participants} participants. Unlike the ANOVA it counts the blinks shown as a sample."
    )
    if random:
        text += f" {said_of_random(random, random_slopes)}"
    if not every:
        text += (
            f" With more than {MAX_CELLS} cells slopes for every effect take minutes (analysis mixed fits "
            "them); without them the p of interactions are too small where people differ in them."
        )
    if random:
        return Section("Linear mixed model", text, (table,))
    return Section(
        "Linear mixed model", text, (table,), (), partial(model_files, analysis, arguments, result)
    )


def ordinal_model(analysis: Analysis) -> Section:
    """The cumulative-link mixed model's tests beside those of the ANOVA."""
    from analysis.models.ordinal import fit_ordinal

    arguments = _model_arguments(analysis)
    random = [name for name in _random_factors(analysis) if name not in arguments["item"]]
    arguments["item"] = [*random, *arguments["item"]]
    every = len(analysis.cells.cells) <= MAX_CELLS
    result = fit_ordinal(**arguments, slopes="all" if every else "main")
    rows = []
    for effect in result.effects:
        ours = analysis.anova.effect(effect.effect)
        cells = (
            fixed(effect.chi2, 3),
            str(effect.df),
            p_value(effect.p_value),
            p_value(first_p(ours, analysis.multivariate_first)),
        )
        rows.append((analysis.labels.effect(ours.factors), *cells))
    header = ("Effect", "χ²", "df", "p", "p of the ANOVA")
    thresholds = ", ".join(fixed(value) for value in result.thresholds)
    notes = (f"Model: {result.formula}.", f"Thresholds: {thresholds}.", *notes_of(result, analysis.labels))
    table = Table(
        "ordinal",
        caption("Ordinal mixed model", analysis.name, analysis.synthetic),
        header,
        tuple(rows),
        1,
        notes,
    )
    text = (
        "Ratings as ordered categories: cumulative logit with free thresholds, participants crossed with "
        f"blinks, by-participant slopes for {'every effect' if every else 'the main effects'}, Laplace "
        "approximation, joint Wald tests."
    )
    if not every:
        text += (
            f" With more than {MAX_CELLS} cells slopes for every effect take minutes (analysis ordinal "
            "--slopes all fits them); without them the p of interactions are too small where people "
            "differ in them."
        )
    if named := _random_factors(analysis):
        text += (
            f" Items are the blinks of each {' and '.join(named)}; effects are not let differ between these, "
            "so that the tests hold for those shown: the linear mixed model says what holds for others."
        )
    return Section(
        "Ordinal mixed model", text, (table,), (), partial(model_files, analysis, arguments, result)
    )


def bayes_factors(analysis: Analysis) -> Section:
    """JZS Bayes factors of the planned pairs (all one-factor pairs where none are planned).

    Source: Rouder et al. (2009), doi:10.3758/PBR.16.2.225.
    """
    planned = analysis.experiment.analysis.pairs if analysis.experiment else ()
    names = [name for name in planned or analysis.anova.all_factors if name in analysis.anova.all_factors]
    rows = []
    for pair in (p for p in analysis.pairs if p.effect in names):
        bf = pair.bayes_factor
        name = analysis.labels.pair(pair.cell_a, pair.cell_b)
        rows.append((name, fixed(pair.t), _factor(bf), _factor(1 / bf if bf else bf), _in_words(bf)))
    header = ("Margin: pair", "t", "BF₁₀", "BF₀₁", "Evidence")
    table = Table(
        "bayes", caption("Bayes factors of pairs", analysis.name, analysis.synthetic), header, tuple(rows), 1
    )
    text = (
        "BF₁₀ says how much better a difference predicts the data than none, BF₀₁ the reverse. JZS prior, "
        "Cauchy scale r = √2/2. Between 1/3 and 3 the data do not tell."
    )
    return Section("Bayes factors", text, (table,))


def _factor(value: float) -> str:
    if not isfinite(value):
        return DASH
    if value >= 1000:
        return f"{value:.1e}"
    if value < 0.001:
        return "<.001"
    return fixed(value, 2 if value >= 0.1 else 3)


def _in_words(bf: float) -> str:
    """Jeffreys' words for the strength of evidence."""
    if not isfinite(bf):
        return DASH
    side, size = ("a difference", bf) if bf >= 1 else ("no difference", 1 / bf if bf > 0 else float("inf"))
    for limit, word in ((3, "weak"), (10, "moderate"), (30, "strong"), (100, "very strong")):
        if size < limit:
            return f"{word}, for {side}"
    return f"extreme, for {side}"
