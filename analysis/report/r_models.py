"""Scripts in R that fit a report's models again, and compare; run where R is installed."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from itertools import count, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis.pairs.abilities import ItemFactors
from analysis.pairs.comparisons import Comparisons
from analysis.pairs.findings import Findings
from analysis.plans.result import Analysis
from analysis.report.r_script import SCRIPT, as_csv, head_of_script, r_number
from analysis.report.write import fill_template
from analysis.within.strata import effect_members
from experiments.errors import InputError

if TYPE_CHECKING:
    from analysis.models.ordinal import OrdinalResult
    from analysis.models.random_part import MixedResult
    from analysis.thresholds.answers import Answers
    from analysis.thresholds.likelihood import Trials
    from analysis.thresholds.psychometric import Threshold
    from analysis.thresholds.series import Difference, SeriesFit


# A script in R that fits the mixed and ordinal models of a report again, and compares.

Rows = list[list[Any]]

MODEL_SCRIPTS = tuple(f"{kind}-{SCRIPT}" for kind in ("mixed", "ordinal"))
"""How the names of these scripts end."""


def model_files(
    analysis: Analysis, arguments: dict[str, Any], model: "MixedResult | OrdinalResult", key: str = ""
) -> dict[str, bytes]:
    """The script of one model and the ratings it reads, by file name.

    The contrasts of a factor of three levels or more share one variance here, which neither lmer nor clmm
    has: both packages' own likelihood functions are asked for it. No file for an ordinal model with an SD at
    its upper limit, where the likelihood has no maximum.
    """
    from analysis.models.ordinal_maximum import SD_MAX
    from analysis.models.random_part import MixedResult

    is_mixed = isinstance(model, MixedResult)
    # An SD at its limit means that the likelihood rises without an end.
    if not is_mixed and max(c.sd for c in model.components) > SD_MAX - 1e-6:
        return {}
    kind = "mixed" if is_mixed else "ordinal"
    slopes = [c.term for c in model.components if c.group == "participant" and c.term != "intercept"]
    levels = dict(zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True))
    # lmer gives each contrast of three levels or more its own variance; ours share one.
    shared = any(len(levels[name]) > 2 for slope in slopes for name in slope.split(":"))
    own = "-".join(part for part in (key, kind) if part)
    script, data = f"{own}-{SCRIPT}", f"{own}-ratings.csv"
    # Short codes: names of factors may hold what a formula cannot.
    names = {name: f"f{i}" for i, name in enumerate(model.factors, start=1)}
    coded = (", ".join(f'"{names[name]}"' for name in slope.split(":")) for slope in slopes)
    # Satterthwaite needs the curvature of the likelihood, which has none at a bound.
    with_df = isinstance(model, MixedResult) and not shared and not model.singular
    text = fill_template(
        "verify-models.R.j2",
        **head_of_script(analysis.title, script, data),
        factors=[{"name": names[name], "levels": len(levels[name])} for name in model.factors],
        slopes=[f"c({slope})" for slope in coded],
        fixed=" * ".join(names.values()),
        mixed=is_mixed,
        ordinal=not is_mixed,
        df=with_df,
        **({} if isinstance(model, MixedResult) else _estimates(model, names, levels)),
        printed=as_csv(
            _printed_mixed(model, names, with_df)
            if isinstance(model, MixedResult)
            else _printed_ordinal(model, names, levels)
        ).strip(),
        floor="1e-3",
        limit="1e-5",
        loose=[f'"{table}"' for table in ("mixed df", "ordinal coefficient", "ordinal se", "ordinal SD")],
    )
    return {script: text.encode(), data: _ratings(arguments, model.factors, names).encode()}


def _printed_mixed(model: "MixedResult", names: dict[str, str], with_df: bool) -> Rows:
    """Criterion, F, and df where lmerTest has them: not of shared variances, nor at a bound."""
    rows: Rows = [["mixed criterion", "REML", r_number(model.reml_criterion)]]
    for effect in model.effects:
        # Sorted: R orders the members of an interaction by its own rules.
        label = ":".join(sorted(names[part] for part in effect.effect.split(":")))
        rows.append(["mixed F", label, r_number(effect.f_value)])
        if with_df:
            rows.append(["mixed df", label, r_number(effect.df_error)])
    return [*rows, ["mixed residual SD", "residual", r_number(model.sigma)]]


def _printed_ordinal(
    model: "OrdinalResult", names: dict[str, str], levels: dict[str, tuple[str, ...]]
) -> Rows:
    thresholds = enumerate(model.thresholds, start=1)
    rows: Rows = [["ordinal likelihood", "log", r_number(model.log_likelihood)]]
    rows += [["ordinal threshold", str(i), r_number(value)] for i, value in thresholds]
    for key, coefficient in zip(_r_columns(model, names, levels), model.coefficients, strict=True):
        rows.append(["ordinal coefficient", key, r_number(coefficient.estimate)])
        rows.append(["ordinal se", key, r_number(coefficient.se)])
    return [*rows, *(["ordinal SD", key, r_number(sd)] for key, sd in _spreads(model))]


def _estimates(
    model: "OrdinalResult", names: dict[str, str], levels: dict[str, tuple[str, ...]]
) -> dict[str, list[str]]:
    """Where the script takes clmm's likelihood: numbers in R, those of a kind with their names."""
    named = zip(_r_columns(model, names, levels), model.coefficients, strict=True)
    return {
        "thresholds": [r_number(value) for value in model.thresholds],
        "coefficients": [f"`{key}` = {r_number(coefficient.estimate)}" for key, coefficient in named],
        "spreads": [f"`{key}` = {r_number(sd)}" for key, sd in _spreads(model)],
    }


def _r_columns(
    model: "OrdinalResult", names: dict[str, str], levels: dict[str, tuple[str, ...]]
) -> list[str]:
    """R's names of the sum-coded coefficients, in the order of those here: R has f2:f3 before f1:f4."""
    return [
        # Sum coding has one column fewer than levels, numbered from 1 in R.
        ":".join(f"{names[model.factors[m]]}{k}" for m, k in zip(members, codes, strict=True))
        for members in effect_members(len(model.factors))
        for codes in product(*(range(1, len(levels[model.factors[m]])) for m in members))
    ]


# Decision 0134: Blinks, not clips, are the items of mixed models.
def _grouping(name: str) -> str:
    """The script's column of a grouping: the one that is not the participant is its item."""
    return name if name == "participant" else "item"


def _spreads(model: "OrdinalResult") -> list[tuple[str, float]]:
    """Standard deviations as named in the script: a group's intercept by name, slopes by number."""
    # Numbers, as terms of slopes have other names in R.
    slopes = count(1)
    return [
        (_grouping(c.group) if c.term == "intercept" else str(next(slopes)), c.sd) for c in model.components
    ]


def _ratings(
    arguments: dict[str, Any],
    factors: Sequence[str],
    names: dict[str, str],
) -> str:
    """Trials with codes for people, items and levels, so that no name is in the code."""
    from analysis.within.level_codes import level_codes

    rows: pd.DataFrame = arguments["rows"]
    items = rows.groupby(list(arguments["item"]), sort=False, observed=True, dropna=False).ngroup()
    columns: list[list[Any]] = [
        # R counts from 1.
        (pd.factorize(rows["participant"].astype(str))[0] + 1).tolist(),
        (items + 1).tolist(),
    ]
    for name in factors:
        # as the model codes them: the labels of an SPSS file are in the order of its codes
        columns.append((level_codes(rows[name], name)[0] + 1).tolist())
    columns.append([r_number(value) for value in rows[arguments["rating"]]])
    header = ["participant", "item", *(names[name] for name in factors), "rating"]
    return as_csv([header, *zip(*columns, strict=True)])


# Scripts in R that compute the reports of pairs and of thresholds again, and compare.

STEEPEST = 1.0
"""A function that rises faster than this from one stimulus to the next is a step between them."""


def pairs_files(
    title: str, comparisons: Comparisons, findings: Findings, factors: ItemFactors | None, key: str = ""
) -> dict[str, bytes]:
    """The script of a report of pairs and the counts of each rater that it reads, by file name.

    No file where nothing was fitted, or with Firth's penalty, which R itself does not have.
    """
    if findings.abilities is None or findings.abilities.firth:
        return {}
    script, data = (f"{key}-{name}" if key else name for name in (SCRIPT, "comparisons.csv"))
    ties = bool(comparisons.ties)
    shown = factors if findings.factors is not None else None
    text = fill_template(
        "verify-pairs.R.j2",
        **head_of_script(title, script, data),
        # A line break in a name would end the comment or string it is written into.
        items=[" ".join(name.split()) for name in comparisons.items],
        ties=ties,
        raters=len(comparisons.participants) > 1,
        factors=[] if shown is None else [_codes(shown, name, comparisons.items) for name in shown.factors],
        printed=as_csv(_printed_pairs(comparisons, findings)).strip(),
        floor="1e-3",
        limit="1e-5",
        loose=[],
    )
    header = ["rater", "left", "right", "left_chosen", "right_chosen", *(["tied"] if ties else [])]
    return {script: text.encode(), data: as_csv([header, *_choices(comparisons, ties)]).encode()}


def _choices(comparisons: Comparisons, ties: bool) -> Rows:
    """How often each rater chose either side of a pair; raters and items are numbers."""
    given = comparisons.participant
    # Choices without a rater count as those of one.
    rater = np.zeros_like(comparisons.left) if given is None else given
    asked, at = np.unique(
        np.stack([rater, comparisons.left, comparisons.right], axis=1), axis=0, return_inverse=True
    )
    # A column for ties only where there are any, as the script expects.
    outcomes = np.zeros((len(asked), 3 if ties else 2), dtype=np.int64)
    np.add.at(outcomes, (at.ravel(), comparisons.outcome), 1)
    # R counts from 1.
    rows: Rows = np.hstack([asked + 1, outcomes]).tolist()
    return rows


def _codes(factors: ItemFactors, name: str, items: Sequence[str]) -> str:
    """The level of each item in a factor, as numbers."""
    levels, at = factors.names(name), factors.factors.index(name)
    return f"c({', '.join(str(levels.index(factors.levels[item][at]) + 1) for item in items)})"


def _printed_pairs(comparisons: Comparisons, findings: Findings) -> Rows:
    result = findings.abilities
    if result is None:
        return []
    number = {name: position for position, name in enumerate(comparisons.items, start=1)}
    rows: Rows = []
    for item in result.items:
        rows += [["ability", number[item.name], item.ability], ["se", number[item.name], item.se]]
        if item.se_robust is not None:
            rows.append(["robust se", number[item.name], item.se_robust])
    for c in result.contrasts:
        label = f"{number[c.first]} {number[c.second]}"
        rows += [["difference", label, c.difference], ["difference se", label, c.se]]
        rows += [["difference p", label, c.p], ["difference p Holm", label, c.p_holm]]
        if c.se_robust is not None:
            rows += [["difference robust se", label, c.se_robust], ["difference robust p", label, c.p_robust]]
            rows.append(["robust p Holm", label, c.p_robust_holm])
    if findings.equal is not None:
        rows += [["equal abilities", "chi2", findings.equal.chi2], ["equal abilities", "p", findings.equal.p]]
    if findings.order is not None:
        rows += [["advantage of a side", "estimate", findings.order.estimate]]
        rows += [["advantage of a side", "se", findings.order.se]]
    if findings.factors is not None:
        tests = findings.factors.factors
        # The last test is of the fit of all factors together.
        keys = [*range(1, len(tests)), "fit"]
        rows += [["factor chi2", name, test.chi2] for name, test in zip(keys, tests, strict=True)]
    return [[table, name, r_number(value)] for table, name, value in rows]


def threshold_files(
    title: str,
    fits: "Sequence[SeriesFit]",
    answers: "dict[str, Answers]",
    differences: "Sequence[Difference]",
    key: str = "",
) -> dict[str, bytes]:
    """The script of a report of thresholds and the counted trials it reads, by file name.

    Functions without a best slope, whose threshold may lie anywhere between two stimuli, are left out.
    """
    fitted = {f"s{i}": one for i, one in enumerate(fits, start=1) if one.result is not None}
    if not fitted:
        return {}
    script, data = (f"{key}-{name}" if key else name for name in (SCRIPT, "trials.csv"))
    people = _people(answers)
    # All series of a study declare the same function, so any fit shows it.
    example = next(fit for one in fitted.values() if one.result for fit in one.result.pooled.values())
    printed, pooled, persons, thresholds = _printed_thresholds(fitted, people)
    codes = {one.label: name for name, one in fitted.items()}
    couples = [(codes[d.first], codes[d.second], d) for d in differences if d.what == "threshold"]
    for first, second, d in couples:
        label = f"{first} {second}"
        for name, value in (("difference", d.difference), ("t", d.t), ("df", d.df), ("p", d.p)):
            printed.append([name, label, value])
        printed.append(["p Holm", label, d.p_holm])
    text = fill_template(
        "verify-thresholds.R.j2",
        **head_of_script(title, script, data),
        series=[{"key": name, "label": " ".join(one.label.split())} for name, one in fitted.items()],
        shape=example.shape,
        guess=r_number(example.guess),
        # NA: the lapse rate was fitted, and the script fits it, too.
        lapse="NA" if example.lapse_fitted else r_number(example.lapse),
        falling="TRUE" if example.falling else "FALSE",
        # An empty c() is NULL in R; one empty text keeps it a vector of texts.
        pooled=", ".join(f'"{name}"' for name in pooled) or '""',
        people=", ".join(f'"{name}"' for name in persons) or '""',
        differences=bool(couples),
        thresholds=as_csv(thresholds).strip(),
        couples=", ".join(f'c("{first}", "{second}")' for first, second, _ in couples),
        printed=as_csv([[table, name, r_number(value)] for table, name, value in printed]).strip(),
        floor="1e-3",
        limit="1e-4",
        loose=[],
    )
    return {script: text.encode(), data: as_csv(_trials(fitted, answers, people)).encode()}


def _people(answers: "dict[str, Answers]") -> dict[str, str]:
    """A code for every person, so that no name is in the code."""
    names = sorted(
        {str(name) for one in answers.values() if one.participant is not None for name in one.participant}
    )
    return {name: f"p{i}" for i, name in enumerate(names, start=1)}


def _printed_thresholds(
    fitted: "dict[str, SeriesFit]", people: dict[str, str]
) -> tuple[Rows, list[str], list[str], Rows]:
    """Printed numbers, series and people with a best function, and every person's threshold."""
    printed: Rows = []
    thresholds: Rows = []
    pooled, persons = [], []
    for name, one in fitted.items():
        if one.result is None:
            continue
        for fit in one.result.pooled.values():
            if _is_settled(fit):
                pooled.append(name)
                printed += [
                    ["threshold", f"{name} all", fit.threshold],
                    ["spread", f"{name} all", fit.spread],
                ]
        for person in one.result.people:
            if person.fit is None:
                continue
            label = f"{name} {people[person.participant]}"
            thresholds.append([name, people[person.participant], repr(person.fit.threshold)])
            if _is_settled(person.fit):
                persons.append(label)
                printed += _printed_fit(label, person.fit, one.trials)
    return printed, pooled, persons, thresholds


def _printed_fit(label: str, fit: "Threshold", trials: "Trials") -> Rows:
    """Threshold and spread; not the spread of a step, which the likelihood hardly depends on."""
    steps = np.diff(np.unique(trials.x))
    # Slope times the least distance between stimuli: the rise from one to the next.
    is_step = bool(steps.size) and abs(fit.slope) * float(steps.min()) > STEEPEST
    return [["threshold", label, fit.threshold], *([] if is_step else [["spread", label, fit.spread]])]


def _is_settled(fit: "Threshold") -> bool:
    # Notes of the fit say that its maximum is not unique; R may then end elsewhere.
    return not any("no upper limit" in note or "hardly change" in note for note in fit.notes)


def _trials(fitted: "dict[str, SeriesFit]", answers: "dict[str, Answers]", people: dict[str, str]) -> Rows:
    rows: Rows = [["series", "person", "x", "n", "k"]]
    for name, one in fitted.items():
        given = answers[one.name]
        person = (
            ["all"] * given.x.size
            if given.participant is None
            else [people[str(p)] for p in given.participant]
        )
        keys, at = np.unique(
            # One key of person and stimulus; `!r` keeps every digit of the stimulus.
            np.array([f"{rater} {x!r}" for rater, x in zip(person, given.x.tolist(), strict=True)]),
            return_inverse=True,
        )
        n, k = np.bincount(at), np.bincount(at, weights=given.response)
        # Neither a code nor a number has a blank, so that the key can be taken apart again.
        for label, given_times, yes in zip(keys.tolist(), n.tolist(), k.tolist(), strict=True):
            rater, x = label.split(" ")
            rows.append([name, rater, x, given_times, int(yes)])
    return rows


# Run a report's own R scripts, where R is installed.


def rscript() -> str:
    """The path of Rscript; InputError where no R is installed."""
    path = shutil.which("Rscript")
    if path is None:
        raise InputError(
            "--verify-with-r: Rscript is not on the PATH; install R, or run verify.R on another computer"
        )
    return path


def verify_with_r(files: Sequence[Path], say: Callable[[str], None] = lambda _: None) -> Iterator[str]:
    """Run every script among the report's files, those of models last; what R said of each, as it ends.

    No script is cut off: R's mixed models of many slopes take minutes, on a busy machine more.

    Parameters
    ----------
    files : sequence of Path
        The report's files, of which the scripts are run.
    say : callable
        Called with the name of each script of a model before it begins.

    Raises
    ------
    InputError
        A number differs, a package is missing, or the report has nothing that R can recompute.
    """
    scripts = [path for path in files if path.name.endswith(SCRIPT)]
    if not scripts:
        raise InputError("--verify-with-r: this kind of report has no R script yet")
    # Models last: they take minutes, and the other answers come at once.
    for path in sorted(scripts, key=_is_model):
        if _is_model(path):
            say(path.name)
        yield _run(path)


def _is_model(script: Path) -> bool:
    return script.name.endswith(MODEL_SCRIPTS)


def _run(script: Path) -> str:
    told = subprocess.run(  # noqa: S603 - the project's own script, in a folder that the caller chose
        # No profile of the user may change what the script loads.
        [rscript(), "--vanilla", script.name],
        # R's messages in English, whatever the computer's language: they are searched below.
        env={**os.environ, "LC_ALL": "C.UTF-8"},
        cwd=script.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    if told.returncode != 0:
        # "rror" finds both Error and error.
        said = [
            line for line in (told.stdout + told.stderr).splitlines() if "DIFFER" in line or "rror" in line
        ]
        raise InputError(f"{script}: {' '.join(' | '.join(said).split()) or 'R ended without output'}")
    return told.stdout.strip()
