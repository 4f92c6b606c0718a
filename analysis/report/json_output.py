"""An analysis as JSON: the keys that `analysis anova --json` promises."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from analysis.plans.result import Analysis
from analysis.within.anova import Effect
from analysis.within.homogeneity import box_test, levene_tests
from analysis.within.multivariate_tests import MultivariateTest
from table_files import counted

if TYPE_CHECKING:
    from analysis.plans.exclusions import Exclusions
    from analysis.plans.plan import PlanRows


_OF_SIMPLE = ("univariate", "multivariate", "mauchly", "eta_sq_partial", "eta_sq_partial_ci")


def as_data(analysis: Analysis) -> dict[str, Any]:
    """The JSON document as plain data.

    Keys: name, title, source, synthetic, rating, factors, levels, n_participants, participants, effects,
    marginal_means, pairwise, dropped, decisions,
    robust (null unless asked for), bayes (only if asked for), and exclusions (null for a table without a
    declaration).
    `multivariate`, `mauchly` and `univariate` each have a `..._reason`: why a test is null, else null.
    """
    cells = analysis.cells
    return {
        "name": analysis.name,
        "title": analysis.title,
        "source": analysis.source,
        "synthetic": analysis.synthetic,
        "rating": analysis.rating,
        "factors": list(analysis.anova.factors),
        "levels": {f: list(names) for f, names in zip(cells.factors, cells.levels, strict=True)},
        "labels": {
            "factors": {f: analysis.labels.factor(f) for f in cells.factors},
            "levels": {
                f: {name: analysis.labels.level(f, name) for name in names}
                for f, names in zip(cells.factors, cells.levels, strict=True)
            },
        },
        "between": _between(analysis),
        "covariates": [
            {
                "name": c.name,
                "centre": c.centre,
                "mean": float(c.values.mean()),
                "sd": float(c.values.std(ddof=1)),
            }
            for c in analysis.anova.between.covariates
        ],
        "type": analysis.anova.sum_of_squares,
        "n_participants": analysis.n_participants,
        "participants": list(cells.participants),
        "confidence": analysis.anova.confidence,
        "effects": [_effect(effect) for effect in analysis.anova.effects],
        "marginal_means": [asdict(mean) for mean in analysis.means],
        "pairwise": [asdict(pair) for pair in analysis.pairs],
        "box_m": None if (box := box_test(analysis.anova)) is None else asdict(box),
        "levene": [asdict(test) for test in levene_tests(analysis.anova)],
        "simple_effects": [
            {
                "interaction": simple.interaction,
                "of": simple.of,
                "at": simple.at,
                "p_value": simple.p_value,
                "p_holm": simple.p_holm,
                **{key: value for key, value in _effect(simple.test).items() if key in _OF_SIMPLE},
            }
            for simple in analysis.simple_effects
        ],
        "trends": [asdict(trend) for trend in analysis.trends],
        "contrasts": [asdict(contrast) for contrast in analysis.contrasts],
        "equivalence": [asdict(test) for test in analysis.equivalence],
        "dropped": [
            {"participant": d.participant, "missing_cells": list(d.missing_cells)} for d in cells.dropped
        ],
        "constant_participants": list(cells.constant),
        "decisions": list(analysis.decisions),
        **({} if analysis.bayes is None else {"bayes": asdict(analysis.bayes)}),
        "robust": None if analysis.robust is None else asdict(analysis.robust),
        "exclusions": None if analysis.exclusions is None else exclusions_data(analysis.exclusions),
    }


def _between(analysis: Analysis) -> list[dict[str, Any]]:
    design = analysis.anova.between
    return [
        {"factor": name, "levels": list(levels)}
        for name, levels in zip(design.factors, design.levels, strict=True)
    ]


def _effect(effect: Effect) -> dict[str, Any]:
    return {
        "effect": effect.effect,
        "between": list(effect.between),
        "within": list(effect.within),
        "univariate": effect.univariate._asdict(),
        "univariate_reason": effect.univariate_reason,
        "multivariate": None if effect.multivariate is None else _multivariate(effect.multivariate),
        "multivariate_reason": effect.multivariate_reason,
        "mauchly": None if effect.mauchly is None else asdict(effect.mauchly),
        "mauchly_reason": effect.mauchly_reason,
        "eta_sq_partial": effect.eta_sq_partial,
        "eta_sq_partial_ci": list(effect.eta_sq_partial_ci),
        "eta_sq_generalized": effect.eta_sq_generalized,
        "omega_sq_partial": effect.omega_sq_partial,
    }


def _multivariate(test: MultivariateTest) -> dict[str, Any]:
    own = (
        "pillai",
        "wilks",
        "hotelling_lawley",
        "roy",
        "f_value",
        "df_effect",
        "df_error",
        "p_value",
        "exact",
    )
    return {
        **{name: getattr(test, name) for name in own},
        "eta_sq_partial": test.eta_sq_partial,
        "eta_sq_partial_ci": list(test.eta_sq_partial_ci),
        "statistics": asdict(test.statistics),
    }


def study_data(prepared: "PlanRows", people: int) -> dict[str, Any]:
    """What the JSON document of a study of any kind begins with.

    Parameters
    ----------
    people : int
        Those who are analyzed.
    """
    experiment = prepared.experiment
    return {
        "name": experiment.name,
        "title": experiment.title,
        "kind": experiment.trial.kind,
        "source": prepared.source,
        "synthetic": prepared.synthetic,
        "n_participants": people,
    }


def exclusions_data(exclusions: "Exclusions") -> dict[str, Any]:
    """Exclusions and decisions."""
    return {
        "runs": [asdict(run) for run in exclusions.runs],
        "trials": [asdict(dropped) for dropped in exclusions.trials],
        "set_aside": list(exclusions.set_aside),
        "not_applied": list(exclusions.not_applied),
        "n_runs": exclusions.n_runs,
    }


# Exclusions and decisions of an analysis, in words.


def left_out(exclusions: "Exclusions") -> tuple[str, ...]:
    """Exclusions with their reasons, one line each; a single line if there are none."""
    lines = [
        f"participant {run.participant}{f' (run {run.run})' if run.run != run.participant else ''} excluded: "
        f"{'; '.join(run.reasons)}"
        for run in exclusions.runs
    ]
    lines += [
        f"{counted(d.trials, 'trial')} of {counted(d.participants, 'participant')} excluded: {d.rule}"
        for d in exclusions.trials
    ]
    if not lines:
        people = int(exclusions.rows["participant"].nunique())
        # A participant without ratings in a cell may still be excluded: the decisions name that one.
        lines = [f"No trial was excluded by rule or manually (of {counted(people, 'participant')})"]
        if exclusions.set_aside:
            *others, last = exclusions.set_aside
            named = f"{', '.join(others)} and {last}" if others else last
            one = not others and last.startswith("1 ")
            lines = [f"{lines[0]}; {named} {'was' if one else 'were'} set aside"]
    else:
        lines += [f"set aside: {aside}" for aside in exclusions.set_aside]
    lines += [f"rule not applied: {reason}" for reason in exclusions.not_applied]
    return tuple(lines)
