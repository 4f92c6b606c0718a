"""The Methods of a study, from its declaration, its stored runs and, where there is one, its report."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from experiments.files import whole_file
from server.models import Study
from server.results.methods_clauses import DescribedSeries, Methods, declared_numbers, sentences
from server.results.methods_repository import Number, numbers, used_versions
from server.studies.lookup import definition_of, version_numbered
from server.studies.series import series_of, version_of_series

RESULTS = "results.json"
METHOD_MARK = "<!-- after the method -->"
"""Where `analysis run` leaves room in its page."""


def methods_of(
    session: Session, study: Study, origin: str, series: int | None, results: dict[str, Any] | None = None
) -> Methods:
    """The paragraph; `results` are those of a report, which says how many each declared rule left out."""
    return paragraph_of(methods_figures(session, study, origin, series), results)


@dataclass(frozen=True)
class MethodsFigures:
    """What a paragraph needs of the database, taken at one moment."""

    study: str
    described: DescribedSeries


def methods_figures(session: Session, study: Study, origin: str, series: int | None) -> MethodsFigures:
    """What the database has to say of a series: its declarations and every number."""
    version = version_of_series(session, study, series)
    experiment = definition_of(version)
    used = [
        (one, definition_of(version_numbered(session, study, one.number)))
        for one in used_versions(session, study.id, origin, version.series)
    ]
    described = DescribedSeries(
        study=study.id,
        origin=origin,
        series=version.series,
        experiment=experiment,
        used=used,
        rules=(),
        elsewhere="" if used else _runs_elsewhere(session, study, origin, version.series),
        is_open=study.status != "closed",
        numbers=numbers(session, study.id, origin, version.series) | declared_numbers(experiment),
    )
    return MethodsFigures(study.name, described)


PEOPLE = {
    "participant": ("participant is", "participants are"),
    "pilot": ("pilot visit is", "pilot visits are"),
    "simulated": ("simulated visit is", "simulated visits are"),
}


def _runs_elsewhere(session: Session, study: Study, origin: str, series: int) -> str:
    """Where the visits of an origin are that a series has none of; empty where there are none at all."""
    placed = []
    for other in series_of(session, study):
        runs = other.runs.get(origin, 0)
        if other.number != series and runs:
            one, several = PEOPLE[origin]
            placed.append(f"{runs} {one if runs == 1 else several} in {other.name}")
    return "; ".join(placed)


def paragraph_of(known: MethodsFigures, results: dict[str, Any] | None) -> Methods:
    """The paragraph of what was counted, and of the results of a report."""
    reasons: dict[str, list[str]] = {}
    for rule in known.described.experiment.exclusions:
        reasons.setdefault(rule.rule, []).append(rule.reason())
    # The report counts by the name of a rule, which may be declared with several limits.
    excluded = _exclusion_counts(results, {name: " or ".join(said) for name, said in reasons.items()})
    described = replace(
        known.described,
        rules=[(name, words) for name, (words, _) in excluded.items()],
        numbers=known.described.numbers | {name: number for name, (_, number) in excluded.items()},
    )
    lines = sentences(described)
    of = described
    return Methods(known.study, of.origin, of.series, lines, of.numbers)


def read_results(folder: Path) -> dict[str, Any] | None:
    """The numbers of the report in this folder; None where it has none."""
    path = folder / RESULTS
    results = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    return results if isinstance(results, dict) else None


def write(folder: Path, methods: Methods) -> None:
    """Put the paragraph into a report, and next to it as text, as LaTeX, and with its numbers as JSON."""
    page = folder / "report.html"
    written = page.read_text(encoding="utf-8").replace(METHOD_MARK, methods.html(), 1)
    with whole_file(page) as temporary:
        temporary.write_text(written, encoding="utf-8")
    write_beside(folder, methods)


def write_beside(folder: Path, methods: Methods) -> None:
    """Put the paragraph into a folder as text, as LaTeX, and with its numbers as JSON."""
    for name, content in (("txt", methods.text()), ("tex", methods.latex()), ("json", methods.json())):
        (folder / f"methods.{name}").write_text(content, encoding="utf-8")


def _exclusion_counts(
    results: dict[str, Any] | None, reasons: Mapping[str, str]
) -> dict[str, tuple[str, Number]]:
    """Number of runs (or trials) by declared rule, as the report counts them."""

    def said(noun: str, rule: str) -> str:
        name = f"{noun}s_{_key(rule)}"
        return f"{{{name}}} {{{name}:{noun}|{noun}s}} for {reasons.get(rule, rule.replace('_', ' '))}"

    left_out = (results or {}).get("exclusions") or {}
    counts: dict[str, int] = {}
    for run in left_out.get("runs", []):
        for rule in {str(reason).split(":", 1)[0] for reason in run["reasons"]}:
            counts[rule] = counts.get(rule, 0) + 1
    excluded = {
        f"visits_{_key(rule)}": (said("visit", rule), count, "exclusions.runs[].reasons")
        for rule, count in counts.items()
    }
    trials: dict[str, int] = {}
    for dropped in left_out.get("trials", []):
        trials[dropped["rule"]] = trials.get(dropped["rule"], 0) + int(dropped["trials"])
    excluded |= {
        f"trials_{_key(rule)}": (said("trial", rule), count, "exclusions.trials[]")
        for rule, count in trials.items()
    }
    return {
        name: (words, Number(name, count, f"{RESULTS} of the report: {source} of this rule"))
        for name, (words, count, source) in excluded.items()
    }


def _key(rule: str) -> str:
    return "_".join(rule.lower().split())
