"""Paired comparisons as tables and words."""

from analysis.pairs.pairs_result import Contrast, PairsResult
from analysis.report.captions import caption, marked
from analysis.report.formats import Table
from analysis.report.numbers import DASH, apa_p, fixed, interval, p_value


def abilities_table(result: PairsResult, name: str, synthetic: bool = False) -> Table:
    """Items from the ablest down, against the reference."""
    robust = any(item.se_robust is not None for item in result.items)
    header = ["Item", "Rank", "Ability", "SE", *(["robust SE"] if robust else []), "95% CI", "p", "W/L/T"]
    rows = []
    for item in sorted(result.items, key=lambda one: (one.rank, one.name)):
        errors = [item.se, *([item.se_robust] if item.se_robust is not None else [])]
        row = [item.name, str(item.rank), fixed(item.ability, 3), *(fixed(error, 3) for error in errors)]
        is_reference = item.name == result.reference
        row += [DASH if is_reference else interval((item.ci_low, item.ci_high)), p_value(item.p)]
        rows.append((*row, f"{item.wins}/{item.losses}/{item.ties}"))
    said = f"Abilities in {result.scale}; '{result.reference}' is 0. W/L/T: won, lost, tied."
    if robust:
        said += " CI and p by the model's SE; robust p of every difference stand with the differences."
    notes = (said,)
    title = caption("Abilities", name, synthetic)
    return Table("abilities", title, tuple(header), tuple(rows), 1, notes)


def contrasts_table(result: PairsResult, name: str, synthetic: bool = False) -> Table:
    """Every pair of items, Holm-corrected: by the model's errors, and by those that count raters."""
    robust = any(c.se_robust is not None for c in result.contrasts)
    rows = tuple(
        (
            f"{c.first} - {c.second}",
            *(fixed(c.difference, 3), fixed(c.se, 3), fixed(c.z), p_value(c.p_holm)),
            *(_robust_cells(c) if robust else ()),
        )
        for c in result.contrasts
    )
    title = caption("Differences between items", name, synthetic)
    header = ("Items", "Difference", "SE", "z", "p", *(("robust SE", "t", "robust p") if robust else ()))
    return Table("pair-contrasts", title, header, rows, 1, (_which_errors(result, robust),), True)


def _robust_cells(contrast: Contrast) -> tuple[str, str, str]:
    se, p = contrast.se_robust, contrast.p_robust_holm
    if se is None or p is None:
        return "" if se is None else fixed(se, 3), DASH, DASH
    return fixed(se, 3), fixed(contrast.difference / se), p_value(p)


def _which_errors(result: PairsResult, robust: bool) -> str:
    """Which errors the p of the contrasts go by, and which to read."""
    if not robust:
        return (
            "SE, z and p by the model, which takes every comparison for one of another rater; with "
            "raters named there are robust ones too. p corrected by Holm."
        )
    return (
        "SE, z and p by the model, which takes every comparison for one of another rater; robust: raters as "
        f"clusters, t on {(result.n_participants or 1) - 1} df. Where raters gave several comparisons and "
        "differ, the robust p are those to report. p corrected by Holm."
    )


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
        f"{marked(name, synthetic)}: {result.method}{' with Firth penalty' if result.firth else ''}, "
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
        said.append(f"{triples.weak_violations} of {triples.triples} triples break weak transitivity.")
    return " ".join([*said, *(f"{decision}." for decision in result.decisions)])
