"""Sensitivity analyses in addition to the ANOVA: Bayes factors, robust companions, mixed and ordinal
models."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from analysis.models.formula import SLOPES_NOTE
from analysis.plans.result import Analysis, Labels
from analysis.report.contents import Section, caption
from analysis.report.formats import Table
from analysis.report.numbers import DASH, apa_p, fixed, p_value
from analysis.report.r_models import model_files
from analysis.within.simple_effects import SIGNIFICANCE, first_p
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.models.columns import RandomSlopes
    from analysis.models.ordinal import OrdinalResult
    from analysis.models.random_part import MixedResult


# What is said under the table of a report's model: its random terms and its doubts, in labels.

_MOVED = re.compile(
    r"(?P<names>.+)(?P<said>: one level per participant, treated as a factor between participants)"
)
_SLOPES = ("slope", "slopes", "test")


def notes_of(result: "MixedResult | OrdinalResult", labels: Labels) -> tuple[str, ...]:
    """Standard deviations of the random terms, a grouping after another, and what was doubtful; in labels."""
    by_group: dict[str, list[str]] = {}
    for one in result.components:
        group = f"{labels.term(one.group)}:" if one.term else one.group
        by_group.setdefault(group, []).append(f"{labels.term(one.term)} {fixed(one.sd, 3)}".strip())
    said = "; ".join(f"{group} {', '.join(terms)}" for group, terms in by_group.items())
    sds = (f"Standard deviations: {said}.",) if said else ()
    slopes = any(one.term not in ("", "intercept") for one in result.components)
    return (
        *sds,
        *((SLOPES_NOTE,) if slopes and result.slopes != "correlated" else ()),
        *(_in_labels(note, result, labels) for note in result.notes),
    )


def _in_labels(note: str, result: "MixedResult | OrdinalResult", labels: Labels) -> str:
    """A note with labels instead of terms; a factor may have the name of a word in the note, such as fit."""
    # This note lists factors, not effects, so every name is replaced separately.
    if moved := _MOVED.fullmatch(note):
        return ", ".join(map(labels.term, moved["names"].split(", "))) + moved["said"]
    said = {
        f"{one.group} {one.term}": f"{labels.term(one.group)} {labels.term(one.term)}"
        for one in result.components
        if one.term
    }
    for effect in result.effects:
        said |= {f"{word} of {effect.effect}": f"{word} of {labels.term(effect.effect)}" for word in _SLOPES}
    # The longest phrase first, or one that begins another would be replaced within it.
    phrases = "|".join(sorted(map(re.escape, said), key=len, reverse=True))
    # A name next to a word character or a colon is a part of another name.
    return re.sub(rf"(?<![\w:])(?:{phrases})(?!\w|:\w)", lambda one: said[one[0]], note)


# The linear mixed model of a report where factors are random: which tests hold for others of them.

MAX_SLOPES = 500
"""With more coefficients of levels than this the model would keep the report waiting."""


def fit_with_random(
    arguments: dict[str, Any], random: list[str], every: bool
) -> "tuple[MixedResult, RandomSlopes]":
    """The fit whose effects may differ between the levels of random factors, as many as the data allow.

    The test of an effect holds for other levels only where it may differ between those shown. Slopes have a
    variance an effect, as those of participants: nested intercepts (`1 | face:A:B`) would share one variance
    among all contrasts, and too little of it with an interaction that alone differs between levels.

    Parameters
    ----------
    arguments : dict of str to Any
        Those of `fit_mixed` that are the same for every model.
    random : list of str
        The random factors; none for a model without.
    every : bool
        Whether participants have slopes of every effect; else of main effects.
    """
    # Imported when needed: these modules make the start of every command slower.
    import numpy as np

    from analysis.models.mixed import fit_mixed

    for slopes in _tried(arguments, random, every):
        chosen = _without_items_of_slopes(arguments, random) if slopes == "all" else arguments
        try:
            fitted = fit_mixed(
                **chosen, random=random, slopes="all" if every else "main", random_slopes=slopes
            )
        except (InputError, np.linalg.LinAlgError):
            # More slopes than the data determine: the next fewer are tried.
            continue
        return fitted, slopes
    # Intercepts alone are determined wherever a model is: no further fallback.
    return fit_mixed(**arguments, random=random, slopes="all" if every else "main"), "none"


def _tried(arguments: dict[str, Any], random: list[str], every: bool) -> "tuple[RandomSlopes, ...]":
    if not random:
        return ()
    rows, factors = arguments["rows"], [*arguments["within"], *arguments["between"]]
    levels = sum(rows[name].nunique() for name in random)
    small = levels * len(rows[factors].drop_duplicates()) <= MAX_SLOPES
    # Random factors never get more slopes than participants have.
    return ("all", "main") if every and small else ("main",)


def _without_items_of_slopes(arguments: dict[str, Any], random: list[str]) -> dict[str, Any]:
    """The same without items where each is a cell of a random factor: its slopes hold what they would."""
    rows, items = arguments["rows"], list(arguments["item"])
    own = [name for name in random if name in items]
    # With two random factors among the items, the cells of neither are the items.
    if len(own) != 1:
        return arguments
    cells = [*own, *arguments["within"], *arguments["between"]]
    one_each = len(rows[cells].drop_duplicates()) == len(rows[[*cells, *items]].drop_duplicates())
    return arguments | {"item": None} if one_each else arguments


def holds_for(effect: str, random: list[str], slopes: "RandomSlopes") -> str:
    """For which levels of the random factors a test holds."""
    # Main slopes vary main effects only: an interaction is tested as if it were the same everywhere.
    tested = slopes == "all" or (slopes == "main" and ":" not in effect)
    names = " and ".join(random)
    return f"others of {names}" if tested else f"the {names} shown"


def said_of_random(random: list[str], slopes: "RandomSlopes") -> str:
    """What the report says of the random factors."""
    names = ", ".join(random)
    if slopes == "none":
        return (
            f"{names}: random, with an intercept per level only, because effects that differ between levels "
            "could not be fitted. The tests hold only for the levels shown."
        )
    which = "every effect" if slopes == "all" else "each main effect"
    text = (
        f"{names}: random, with an intercept and slopes for {which} per level. Tests of these effects "
        "generalize to similar levels; with few levels they have few df."
    )
    if slopes == "main":
        text += (
            " There were too many slopes for interactions to fit them: tests of interactions hold only for "
            "the levels shown."
        )
    return text


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
        # A model that cannot be fitted must not cost the reader the rest of the report.
        except InputError as error:
            sections.append(Section(title, f"Not fitted: {error}."))
    return tuple(sections)


def robust_companions(analysis: Analysis, progress: Callable[[str], None] = lambda _: None) -> Section:
    """Permutations, aligned ranks and trimmed means in addition to the ANOVA."""
    from analysis.report.rating_tables import robust_section
    from analysis.robust import companions_of

    progress("robust companions")
    # A report may have computed them already; the permutations take longest.
    return robust_section(analysis, analysis.robust or companions_of(analysis.anova))


def _no_models(analysis: Analysis) -> str | None:
    if analysis.exclusions is None or analysis.experiment is None:
        return "no experiment is declared, so the rated items are unknown"
    rows = analysis.exclusions.rows
    if "exemplar" not in rows.columns or rows["exemplar"].isna().any():
        return "the data do not say which exemplar was rated"
    if len(rows) > MAX_RATINGS:
        limit = f"{len(rows):,} ratings exceed the limit of {MAX_RATINGS:,}"
        return f"{limit}; use analysis mixed and analysis ordinal"
    return None


def _model_arguments(analysis: Analysis) -> dict[str, Any]:
    """Rows of the participants in the ANOVA, and the columns that name the blink shown."""
    if analysis.exclusions is None or analysis.experiment is None:
        raise InputError("models need a declared experiment")
    rows = analysis.exclusions.rows
    # The ANOVA leaves out incomplete participants; the models must compare with the same people.
    rows = rows[rows["participant"].isin(list(analysis.cells.participants)).to_numpy()]
    return {
        "rows": rows,
        "participant": "participant",
        "rating": "response",
        "within": list(analysis.anova.factors),
        "between": list(analysis.anova.between.factors),
        # An exemplar's number alone is not an item: every level of these factors has a number 1.
        "item": [*analysis.experiment.exemplars.own_per, "exemplar"],
    }


def _random_factors(analysis: Analysis) -> list[str]:
    declared = analysis.experiment.factors if analysis.experiment is not None else ()
    return [factor.name for factor in declared if factor.random]


def mixed_model(analysis: Analysis) -> Section:
    """The linear mixed model's tests next to those of the ANOVA."""
    # More cells would make slopes for every effect take minutes.
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
        f"Satterthwaite's df; {result.n_ratings:,} ratings of {result.n_items} blinks by "
        f"{result.n_participants} participants. Unlike the ANOVA, it treats the blinks shown as a sample."
    )
    if random:
        text += f" {said_of_random(random, random_slopes)}"
    if not every:
        text += (
            f" With more than {MAX_CELLS} cells, slopes for every effect take minutes (analysis mixed fits "
            "them). Without them, the p of interactions is too small if people differ in them."
        )
    section = Section("Linear mixed model", text, (table,), sentences=_disagreements(analysis, result))
    # The R script has no counterpart of slopes for random factors, so none is written.
    if random:
        return section
    return replace(section, beside=partial(model_files, analysis, arguments, result))


def _disagreements(analysis: Analysis, result: "MixedResult") -> tuple[str, ...]:
    """Effects that are significant in the ANOVA or in the mixed model, not in both: one sentence."""
    said = []
    for effect in result.effects:
        ours = analysis.anova.effect(effect.effect)
        anova_p = first_p(ours, analysis.multivariate_first)
        significant = effect.p_value < SIGNIFICANCE
        if not isfinite(anova_p) or significant == (anova_p < SIGNIFICANCE):
            continue
        said.append(
            f"{analysis.labels.effect(ours.factors)} was {'' if significant else 'not '}significant, "
            f"F({effect.df_effect}, {fixed(effect.df_error)}) = {fixed(effect.f_value)}, "
            f"{apa_p(effect.p_value)}"
        )
    if not said:
        return ()
    return (f"The linear mixed model with blinks as random disagrees with the ANOVA: {'; '.join(said)}.",)


def ordinal_model(analysis: Analysis) -> Section:
    """The cumulative-link mixed model's tests next to those of the ANOVA."""
    from analysis.models.ordinal import fit_ordinal

    arguments = _model_arguments(analysis)
    # Random factors become a part of the item, so that blinks of two levels are two items.
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
    notes = (
        f"Model: {result.formula}, logit link.",
        f"Thresholds: {thresholds}.",
        *notes_of(result, analysis.labels),
    )
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
            f" With more than {MAX_CELLS} cells, slopes for every effect take minutes (analysis ordinal "
            "--slopes all fits them). Without them, the p of interactions is too small if people differ in "
            "them."
        )
    if named := _random_factors(analysis):
        text += (
            f" Items are the blinks of each {' and '.join(named)}. Effects do not differ between these in "
            "this model, so the tests hold only for those shown. See the linear mixed model for tests that "
            "generalize."
        )
    return Section(
        "Ordinal mixed model", text, (table,), (), partial(model_files, analysis, arguments, result)
    )


def bayes_factors(analysis: Analysis) -> Section:
    """JZS Bayes factors of every pair of one factor.

    Source: Rouder et al. (2009), doi:10.3758/PBR.16.2.225.
    """
    rows = []
    for pair in (p for p in analysis.pairs if p.effect in analysis.anova.all_factors):
        bf = pair.bayes_factor
        name = analysis.labels.pair(pair.cell_a, pair.cell_b)
        # A factor that underflows to 0 has an infinite reciprocal.
        reverse = 1 / bf if bf else inf
        rows.append((name, fixed(pair.t), factor_text(bf), factor_text(reverse), _in_words(bf)))
    header = ("Margin: pair", "t", "BF₁₀", "BF₀₁", "Evidence")
    table = Table(
        "bayes", caption("Bayes factors of pairs", analysis.name, analysis.synthetic), header, tuple(rows), 1
    )
    text = (
        "BF₁₀ compares a difference with no difference; BF₀₁ is the reverse. JZS prior (Rouder et al., "
        "2009), Cauchy scale r = √2/2. Values between 1/3 and 3 are weak (inconclusive) evidence."
    )
    return Section("Bayes factors", text, (table,))


_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def factor_text(value: float) -> str:
    """A Bayes factor, which has no upper bound: with its leading zero, large ones as powers of ten."""
    if not isfinite(value):
        return DASH
    if value >= 1000:
        mantissa, exponent = f"{value:.1e}".split("e+")
        return f"{mantissa} × 10{str(int(exponent)).translate(_RAISED)}"
    if value < 0.001:
        return "<0.001"
    return fixed(value, 2 if value >= 0.1 else 3)


def _in_words(bf: float) -> str:
    """Jeffreys' words for the strength of evidence."""
    if not isfinite(bf):
        return DASH
    # One scale serves both directions: evidence against is the reciprocal.
    side, size = ("a difference", bf) if bf >= 1 else ("no difference", 1 / bf if bf > 0 else float("inf"))
    for limit, word in ((3, "weak"), (10, "moderate"), (30, "strong"), (100, "very strong")):
        if size < limit:
            return f"{word}, for {side}"
    return f"extreme, for {side}"
