"""Reliability and agreement as tables and words."""

from analysis.agreement.raters import Agreement
from analysis.agreement.reliability import Reliability
from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, fixed, share


def reliability_text(result: Reliability, name: str, synthetic: bool = False) -> str:
    """Alpha and omega in a sentence, then what was decided."""
    alpha = f"{share(result.alpha, 3)}, 95% CI {_interval(result.alpha_low, result.alpha_high)}"
    omega = result.omega_reason if result.omega is None else f"McDonald's omega = {share(result.omega, 3)}"
    said = (
        f"{marked(name, synthetic)}: {len(result.items)} items, {result.n_cases} cases; Cronbach's alpha = "
        f"{alpha}; {omega}."
    )
    return " ".join([said, *(f"{decision}." for decision in result.decisions)])


def items_table(result: Reliability, name: str, synthetic: bool = False) -> Table:
    """The items in the order asked for."""
    rows = tuple(
        (
            item.name,
            fixed(item.mean),
            fixed(item.sd),
            share(item.item_rest_correlation, 2),
            DASH if item.loading is None else share(item.loading, 2),
            DASH if item.alpha_without is None else share(item.alpha_without, 3),
        )
        for item in result.items
    )
    header = ("Item", "Mean", "SD", "r with rest", "Loading", "alpha without")
    return Table("items", caption("Items of the scale", name, synthetic), header, rows, 1)


def agreement_text(result: Agreement, name: str, synthetic: bool = False) -> str:
    """Krippendorff's alpha in a sentence, then what was decided."""
    alpha = f"{share(result.krippendorff_alpha, 3)}, 95% CI {_interval(result.ci_low, result.ci_high)}"
    said = (
        f"{marked(name, synthetic)}: {result.n_ratings} ratings of {result.n_items} items by "
        f"{result.n_people} people; Krippendorff's alpha ({result.level}) = {alpha} (items resampled)."
    )
    reason = [f"{result.icc_reason}."] if result.icc_reason else []
    return " ".join([said, *reason, *(f"{decision}." for decision in result.decisions)])


def intraclass_table(result: Agreement, name: str, synthetic: bool = False) -> Table:
    """The six forms, over the items that everybody rated."""
    rows = tuple(
        (
            one.form,
            share(one.icc, 3),
            _interval(one.ci_low, one.ci_high),
            f"{fixed(one.f_value)} ({one.df_effect:g}, {one.df_error:g})",
            one.meaning,
        )
        for one in result.icc
    )
    header = ("Form", "ICC", "95% CI", "F (df)", "Of what")
    notes = (f"Over the {result.n_complete_items} items that everybody rated.",)
    return Table("icc", caption("Intraclass correlations", name, synthetic), header, rows, 1, notes)


def _interval(low: float, high: float) -> str:
    return f"[{share(low, 3)}, {share(high, 3)}]"
