"""Mixed and ordinal models as tables."""

from analysis.models.mixed_result import MixedResult
from analysis.models.ordinal_result import OrdinalResult
from analysis.report.captions import caption
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, p_value

DF_NAMES = {"satterthwaite": "Satterthwaite's", "kenward-roger": "Kenward and Roger's"}
PROFILE = "Intervals: profile likelihood (maximum likelihood)."


def mixed_effects_table(result: MixedResult, name: str, synthetic: bool) -> Table:
    """Type III tests with their denominator df."""
    rows = tuple(
        (e.effect, fixed(e.f_value), str(e.df_effect), fixed(e.df_error, 1), p_value(e.p_value))
        for e in result.effects
    )
    return Table(
        "mixed", caption("Linear mixed model", name, synthetic), ("Effect", "F", "df1", "df2", "p"), rows, 1
    )


def mixed_components_table(result: MixedResult, name: str, synthetic: bool) -> Table:
    """Standard deviations of the random terms."""
    title = caption("Random effects", name, synthetic)
    if result.components[-1].ci is None:
        rows = tuple((c.group, c.term or "residual", fixed(c.sd, 3)) for c in result.components)
        return Table("mixed-random", title, ("Group", "Term", "SD"), rows, 2)
    more = tuple((c.group, c.term or "residual", fixed(c.sd, 3), _interval(c.ci)) for c in result.components)
    return Table("mixed-random", title, ("Group", "Term", "SD", "95% CI"), more, 2, (PROFILE,))


def mixed_coefficients_table(result: MixedResult, name: str, synthetic: bool) -> Table:
    """Sum-coded coefficients with their profile intervals."""
    rows = tuple(
        (c.name, fixed(c.estimate, 3), fixed(c.se, 3), fixed(c.df, 1), p_value(c.p_value), _interval(c.ci))
        for c in result.coefficients
    )
    header = ("Coefficient", "b", "SE", "df", "p", "95% CI")
    return Table("mixed-coefficients", caption("Coefficients", name, synthetic), header, rows, 1, (PROFILE,))


def _interval(ends: tuple[float, float] | None) -> str:
    return DASH if ends is None else f"[{fixed(ends[0], 3)}, {fixed(ends[1], 3)}]"


def ordinal_effects_table(result: OrdinalResult, name: str, synthetic: bool) -> Table:
    """Joint Wald tests of the effects on the logit scale."""
    rows = tuple((e.effect, fixed(e.chi2), str(e.df), p_value(e.p_value)) for e in result.effects)
    return Table(
        "ordinal", caption("Ordinal mixed model", name, synthetic), ("Effect", "χ²", "df", "p"), rows, 1
    )


def ordinal_coefficients_table(result: OrdinalResult, name: str, synthetic: bool) -> Table:
    """Sum-coded coefficients on the logit scale."""
    rows = tuple(
        (c.name, fixed(c.estimate, 3), fixed(c.se, 3), fixed(c.z), p_value(c.p_value))
        for c in result.coefficients
    )
    header = ("Coefficient", "b", "SE", "z", "p")
    return Table("ordinal-coefficients", caption("Ordinal coefficients", name, synthetic), header, rows, 1)


def ordinal_components_table(result: OrdinalResult, name: str, synthetic: bool) -> Table:
    """Standard deviations of the random terms on the logit scale."""
    rows = tuple((c.group, c.term, fixed(c.sd, 3)) for c in result.components)
    header = ("Group", "Term", "SD")
    return Table("ordinal-random", caption("Random effects (logit)", name, synthetic), header, rows, 2)


def mixed_text(result: MixedResult) -> str:
    """What was fitted, in words."""
    of_items = f"of {result.n_items} items " if result.n_items else ""
    said = [
        f"{result.formula}, fitted by REML (criterion {result.reml_criterion:.2f}) to {result.n_ratings} "
        f"ratings {of_items}by {result.n_participants} participants. Type III tests with "
        f"{DF_NAMES[result.df_method]} degrees of freedom."
    ]
    return " ".join([*said, *(f"{note}." for note in result.notes)])


def _integral(nodes: int) -> str:
    return "Laplace approximation" if nodes == 1 else f"adaptive Gauss-Hermite quadrature with {nodes} nodes"


def ordinal_text(result: OrdinalResult) -> str:
    """What was fitted, in words."""
    said = [
        f"{result.formula} link, flexible thresholds, {_integral(result.quadrature)} (log-likelihood "
        f"{result.log_likelihood:.2f}, AIC {result.aic:.2f}). Wald tests."
    ]
    if result.slopes == "none":
        said.append(
            "Random intercepts only: where people differ in the size of an effect its p is too small; "
            "--slopes all lets them differ."
        )
    return " ".join([*said, *(f"{note}." for note in result.notes)])
