"""Tables of the effects: their tests, what these assume, and their sizes."""

from analysis.plans.result import Analysis
from analysis.report.formats import Table
from analysis.report.numbers import (
    DASH,
    apa_p,
    f_text,
    fixed,
    p_value,
    share,
    share_interval,
    sum_text,
)
from analysis.report.table_cells import title_of
from analysis.within.effects import Effect
from analysis.within.homogeneity import box_test, levene_tests


def univariate_table(analysis: Analysis) -> Table:
    """Univariate tests with uncorrected df."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            sum_text(e.univariate.ss),
            sum_text(e.univariate.ss_error),
            f"{e.univariate.df_effect}, {e.univariate.df_error}",
            f_text(e.univariate.f_value),
            p_value(e.univariate.p_value),
        )
        for e in analysis.anova.effects
    )
    header = ("Effect", "SS", "SS error", "df", "F", "p")
    notes = _reasons(analysis, "univariate_reason")
    return Table("univariate", title_of(analysis, "Univariate tests"), header, rows, 1, notes)


def has_sphericity(effect: Effect) -> bool:
    """Whether an effect has several contrasts within participants, so that sphericity may fail."""
    return effect.mauchly is not None or effect.univariate.epsilon_gg < 1


def sphericity_table(analysis: Analysis) -> Table:
    """Mauchly's test, both epsilons, and p with corrected df; effects with one contrast are left out."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            share(e.mauchly.w) if e.mauchly else DASH,
            p_value(e.mauchly.p_value) if e.mauchly else DASH,
            share(e.univariate.epsilon_gg),
            f"{fixed(e.univariate.df_effect_gg, 1)}, {fixed(e.univariate.df_error_gg, 1)}",
            p_value(e.univariate.p_gg),
            fixed(e.univariate.epsilon_hf, 3),
            f"{fixed(e.univariate.df_effect_hf, 1)}, {fixed(e.univariate.df_error_hf, 1)}",
            p_value(e.univariate.p_hf),
        )
        for e in analysis.anova.effects
        if has_sphericity(e)
    )
    header = ("Effect", "W", "p(W)", "ε GG", "df GG", "p GG", "ε HF", "df HF", "p HF")
    notes = (
        "W: Mauchly's test, textbook form. GG: Greenhouse-Geisser, HF: Huynh-Feldt (printed uncapped, used "
        "as min(1, ε)). Effects with one contrast cannot violate sphericity and are left out.",
        *_reasons(analysis, "mauchly_reason", skip="one contrast"),
    )
    return Table("sphericity", title_of(analysis, "Sphericity and corrections"), header, rows, 1, notes)


def levene_table(analysis: Analysis) -> Table:
    """Levene's test of participants' means and of every cell; empty without groups."""
    tests = levene_tests(analysis.anova)
    rows = tuple(
        (t.where, f_text(t.f_value), f"{t.df_effect}, {t.df_error}", p_value(t.p_value)) for t in tests
    )
    notes: tuple[str, ...] = (
        "Distances from the median of the group (Brown-Forsythe). means: over all cells.",
    )
    box = box_test(analysis.anova)
    if box is not None and box.chi2 is not None and box.p_value is not None:
        said = f"χ²({box.df}) = {fixed(box.chi2)}, {apa_p(box.p_value)}"
        notes = (*notes, f"Box's M of the cells' covariance matrices: {said}.")
    elif box is not None:
        notes = (*notes, f"Box's M: none, {box.reason}.")
    title = title_of(analysis, "Levene's test of equal spread")
    return Table("levene", title, ("Scores", "F", "df", "p"), rows, 1, notes, folded=len(rows) > 12)


def multivariate_table(analysis: Analysis) -> Table:
    """The four multivariate statistics and their F."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            share(e.multivariate.pillai),
            share(e.multivariate.wilks),
            fixed(e.multivariate.hotelling_lawley, 3),
            fixed(e.multivariate.roy, 3),
            f_text(e.multivariate.f_value),
            f"{e.multivariate.df_effect}, {e.multivariate.df_error}",
            p_value(e.multivariate.p_value),
        )
        if e.multivariate
        else (analysis.labels.effect(e.factors), *[DASH] * 7)
        for e in analysis.anova.effects
    )
    header = ("Effect", "Pillai", "Wilks", "H-L", "Roy", "F", "df", "p")
    notes = (
        "H-L: Hotelling-Lawley trace. "
        + (
            "All four give this one exact F."
            if all(e.multivariate.exact for e in analysis.anova.effects if e.multivariate)
            else "F is Pillai's; where an effect has several dimensions it is an approximation."
        ),
        *_reasons(analysis, "multivariate_reason"),
    )
    return Table("multivariate", title_of(analysis, "Multivariate tests"), header, rows, 1, notes)


def effect_size_table(analysis: Analysis) -> Table:
    """Sizes of the univariate effects and, beside them, of the multivariate ones."""
    rows = tuple(
        (
            analysis.labels.effect(e.factors),
            share(e.eta_sq_partial),
            share_interval(e.eta_sq_partial_ci),
            share(e.eta_sq_generalized),
            share(e.omega_sq_partial),
            share(e.multivariate.eta_sq_partial) if e.multivariate else DASH,
            share_interval(e.multivariate.eta_sq_partial_ci) if e.multivariate else DASH,
        )
        for e in analysis.anova.effects
    )
    notes = (
        "ηₚ², ω²ₚ (partial), ηG² (generalised): of the univariate test; its interval uses the df of "
        "Greenhouse-Geisser. mv: ηₚ² of the multivariate test. Intervals: 95%, noncentral F (Steiger 2004).",
    )
    header = ("Effect", "ηₚ²", "95% CI", "ηG²", "ω²ₚ", "mv ηₚ²", "95% CI")
    return Table("effects", title_of(analysis, "Effect sizes"), header, rows, 1, notes)


def _reasons(analysis: Analysis, which: str, skip: str = "\0") -> tuple[str, ...]:
    """Why tests do not exist, one note a reason."""
    effects: dict[str, list[str]] = {}
    for effect in analysis.anova.effects:
        reason = getattr(effect, which)
        if reason is not None and not reason.startswith(skip):
            effects.setdefault(reason, []).append(analysis.labels.effect(effect.factors))
    return tuple(f"Not defined for {', '.join(names)}: {reason}." for reason, names in effects.items())
