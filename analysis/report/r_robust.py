"""A script in R that computes the robust companions of a report anew, and compares."""

from analysis.plans.result import Analysis
from analysis.report.r_script import DATA, SCRIPT, design_in_r, safe_names
from analysis.report.r_text import as_csv, head_of_script, r_number
from analysis.report.templating import filled
from analysis.robust.companions import Companions
from analysis.robust.trimmed import TRIM

ROBUST_SCRIPT = f"robust-{SCRIPT}"


def robust_files(analysis: Analysis, companions: Companions, key: str = "") -> dict[str, bytes]:
    """The script by its file name; it reads the cell means that lie beside `verify.R`."""
    script, data = (f"{key}-{name}" if key else name for name in (ROBUST_SCRIPT, DATA))
    names = safe_names(analysis)
    design = analysis.anova.between
    text = filled(
        "verify-robust.R.j2",
        **head_of_script(analysis.title, script, data),
        **design_in_r(analysis, names),
        between=[names[name] for name in (*design.factors, *(c.name for c in design.covariates))],
        terms=[":".join(names[part] for part in term) for term in design.terms[1:]],
        groups=[names[name] for name in design.factors],
        within=[names[name] for name in analysis.anova.factors],
        trim=TRIM,
        permutations=_permutations(analysis, companions, names),
        ranks=_ranks(analysis, companions, names),
        trimmed=_trimmed(companions, names),
    )
    return {script: text.encode()}


def _permutations(analysis: Analysis, companions: Companions, names: dict[str, str]) -> str:
    rows = []
    for effect, test in zip(analysis.anova.effects, companions.permutations, strict=True):
        between, within = (
            ":".join(names[part] for part in parts) for parts in (effect.between, effect.within)
        )
        exact = "TRUE" if test.exact else "FALSE"
        rows.append(
            [between, within, r_number(test.f_value), r_number(test.p_value), test.n_rearranged, exact]
        )
    return as_csv(rows).strip()


def _ranks(analysis: Analysis, companions: Companions, names: dict[str, str]) -> str:
    rows = []
    for test in companions.ranks:
        factors = analysis.anova.effect(test.effect).factors
        epsilon = test.epsilon_gg if test.epsilon_gg < 1 else float("nan")
        numbers = (test.f_value, test.df_effect, test.df_error, test.p_value, epsilon)
        rows.append([":".join(names[part] for part in factors), *map(r_number, numbers)])
    return as_csv(rows).strip()


def _trimmed(companions: Companions, names: dict[str, str]) -> str:
    rows = []
    for pair in companions.trimmed:
        numbers = (pair.difference, pair.se, pair.df, pair.t, pair.p, pair.p_holm, *pair.ci)
        rows.append([names[pair.effect], *map(r_number, numbers)])
    return as_csv(rows).strip()
