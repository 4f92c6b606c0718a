"""Scripts in R that compute the reports of pairs and of thresholds anew, and compare."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.pairs.comparisons import Comparisons
from analysis.pairs.factors import ItemFactors
from analysis.pairs.findings import Findings
from analysis.report.r_script import SCRIPT
from analysis.report.r_text import as_csv, head_of_script, r_number
from analysis.report.templating import filled

if TYPE_CHECKING:
    from analysis.thresholds.answers import Answers
    from analysis.thresholds.likelihood import Trials
    from analysis.thresholds.psychometric import Threshold
    from analysis.thresholds.series import Difference, SeriesFit

Rows = list[list[Any]]

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
    text = filled(
        "verify-pairs.R.j2",
        **head_of_script(title, script, data),
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
    rater = np.zeros_like(comparisons.left) if given is None else given
    asked, at = np.unique(
        np.stack([rater, comparisons.left, comparisons.right], axis=1), axis=0, return_inverse=True
    )
    outcomes = np.zeros((len(asked), 3 if ties else 2), dtype=np.int64)
    np.add.at(outcomes, (at.ravel(), comparisons.outcome), 1)
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
    example = next(fit for one in fitted.values() if one.result for fit in one.result.pooled.values())
    printed, pooled, persons, thresholds = _printed_thresholds(fitted, people)
    codes = {one.label: name for name, one in fitted.items()}
    couples = [(codes[d.first], codes[d.second], d) for d in differences if d.what == "threshold"]
    for first, second, d in couples:
        label = f"{first} {second}"
        for name, value in (("difference", d.difference), ("t", d.t), ("df", d.df), ("p", d.p)):
            printed.append([name, label, value])
        printed.append(["p Holm", label, d.p_holm])
    text = filled(
        "verify-thresholds.R.j2",
        **head_of_script(title, script, data),
        series=[{"key": name, "label": " ".join(one.label.split())} for name, one in fitted.items()],
        shape=example.shape,
        guess=r_number(example.guess),
        lapse="NA" if example.lapse_fitted else r_number(example.lapse),
        falling="TRUE" if example.falling else "FALSE",
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
    """A code for every person, so that no name stands in code."""
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
    is_step = bool(steps.size) and abs(fit.slope) * float(steps.min()) > STEEPEST
    return [["threshold", label, fit.threshold], *([] if is_step else [["spread", label, fit.spread]])]


def _is_settled(fit: "Threshold") -> bool:
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
            np.array([f"{rater} {x!r}" for rater, x in zip(person, given.x.tolist(), strict=True)]),
            return_inverse=True,
        )
        n, k = np.bincount(at), np.bincount(at, weights=given.response)
        for label, count, yes in zip(keys.tolist(), n.tolist(), k.tolist(), strict=True):
            rater, x = label.split(" ")
            rows.append([name, rater, x, count, int(yes)])
    return rows
