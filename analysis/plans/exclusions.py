"""Apply the exclusion rules an experiment declared before its data; every one named with its reason."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import assert_never

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.study_answers import StudyAnswers
from experiments import rules
from experiments.definition import Experiment
from experiments.rules.exclusion import LeavesOutRuns, LeavesOutTrials, RunTrials, Source


@dataclass(frozen=True)
class ExcludedRun:
    """A participant's run left out as a whole, and every reason for it."""

    participant: str
    run: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class DroppedTrials:
    """Trials left out by one rule: how many, of how many participants."""

    rule: str
    trials: int
    participants: int


@dataclass(frozen=True)
class Exclusions:
    """What was left out and why, and the rows that remain (main trials with a rating)."""

    runs: tuple[ExcludedRun, ...]
    trials: tuple[DroppedTrials, ...]
    set_aside: tuple[str, ...]
    not_applied: tuple[str, ...]
    n_runs: int
    rows: pd.DataFrame = field(repr=False)


def apply_exclusions(experiment: Experiment, ratings: StudyAnswers) -> Exclusions:
    """Set aside what is no main trial, then apply every declared rule.

    Rules about participants see all their main trials; rules about trials see those of who remains. A
    participant's second run is left out, the first that no rule excludes counts.
    """
    rows, aside = _with_run(ratings.rows), list[str]()
    kind = rows["kind"] if "kind" in rows.columns else pd.Series("main", index=rows.index)
    main, attention = rows[(kind == "main").to_numpy()], rows[(kind == "attention").to_numpy()]
    practice = n_plays(rows[~kind.isin(["main", "attention", "check"]).to_numpy()])
    checks = n_plays(rows[(kind == "check").to_numpy()])
    aside += [f"{practice} practice trials"] if practice else []
    aside += [f"{checks} motion checks"] if checks else []
    unrated = np.isnan(main["response"].to_numpy())
    not_applicable = unrated & _not_applicable(main)
    silent = n_plays(main[unrated & ~not_applicable])
    aside += [f"{silent} plays without a rating"] if silent else []
    aside += [f"{not_applicable.sum()} answers that the scale does not apply"] if not_applicable.any() else []
    plays, main = main, main[~unrated]
    people = _people(main, rows)
    reasons, not_applied = _participant_reasons(experiment, rows, plays, attention)
    _later_runs(people, reasons, ratings)
    excluded = tuple(
        ExcludedRun(str(people[run]), str(run), tuple(reasons[run]))
        for run in sorted(reasons)
        if run in people
    )
    kept = main[~main["run"].isin(list(reasons)).to_numpy()]
    kept, dropped, missing = _drop_trials(experiment, kept)
    return Exclusions(excluded, dropped, tuple(aside), (*not_applied, *missing), len(people), kept)


def n_plays(rows: pd.DataFrame) -> int:
    """How many plays the rows are of: a play rated on several scales has a row a scale."""
    keys = [name for name in ("run", "trial_index", "play") if name in rows.columns]
    if "scale" not in rows.columns or "trial_index" not in keys:
        return len(rows)
    return int((~rows.duplicated(keys)).sum())


def _not_applicable(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """True where the answer beside the scale was chosen, that it does not apply."""
    if "not_applicable" not in rows.columns:
        return np.zeros(len(rows), dtype=bool)
    said = rows["not_applicable"].astype(str).str.casefold()
    return said.isin(["1", "1.0", "true", "yes"]).to_numpy()


def _with_run(rows: pd.DataFrame) -> pd.DataFrame:
    return rows if "run" in rows.columns else rows.assign(run=rows["participant"])


def _people(main: pd.DataFrame, rows: pd.DataFrame) -> dict[str, str]:
    """Participant of every run."""
    pairs = rows[["run", "participant"]].drop_duplicates()
    return {str(run): str(who) for run, who in pairs.itertuples(index=False)} if len(main) else {}


def _participant_reasons(
    experiment: Experiment, rows: pd.DataFrame, plays: pd.DataFrame, attention: pd.DataFrame
) -> tuple[dict[str, list[str]], list[str]]:
    reasons: dict[str, list[str]] = {}
    not_applied: list[str] = []
    for run, why in _by_hand(rows):
        reasons.setdefault(run, []).append(why)
    sources: dict[Source, pd.DataFrame] = {"rows": rows, "plays": plays, "attention": attention}
    for rule in experiment.exclusions:
        if not isinstance(rule, LeavesOutRuns):
            continue
        missing = next((name for name in rule.needed if name not in rows.columns), None)
        if missing is not None:
            not_applied.append(f"{rule.rule}: the data have no column '{missing}'")
            continue
        for run, trials in _by_run(sources[rule.source], rule.needed):
            reason = _why(rule, trials)
            if reason is not None:
                reasons.setdefault(run, []).append(f"{rule.rule}: {reason}")
    return reasons, not_applied


def _by_run(rows: pd.DataFrame, names: tuple[str, ...]) -> Iterator[tuple[str, RunTrials]]:
    """Each run's values of some columns."""
    values = {name: rows[name].to_numpy() for name in names}
    for run, places in rows.groupby("run", observed=True).indices.items():
        yield str(run), RunTrials({name: column[places].tolist() for name, column in values.items()})


def _why(rule: rules.ExclusionRule, trials: RunTrials) -> str | None:
    """The rule's own word on a run; a rule that is of neither sort, or has no method, fails type-checking."""
    if isinstance(rule, LeavesOutRuns):
        return rule.excludes(trials)
    if isinstance(rule, LeavesOutTrials):
        return None
    assert_never(rule)


def _by_hand(rows: pd.DataFrame) -> list[tuple[str, str]]:
    if "excluded" not in rows.columns:
        return []
    chosen = rows[rows["excluded"].to_numpy()].drop_duplicates("run")
    given = chosen["exclusion_reason"] if "exclusion_reason" in chosen.columns else [""] * len(chosen)
    return [
        (str(run), f"by hand: {why or 'no reason given'}")
        for run, why in zip(chosen["run"], given, strict=True)
    ]


def _later_runs(people: dict[str, str], reasons: dict[str, list[str]], ratings: StudyAnswers) -> None:
    """Of several runs of a participant that no rule excludes, keep the first."""
    order = sorted(
        (run for run in people if run not in reasons), key=lambda r: (ratings.first_seen.get(r, ""), r)
    )
    seen: set[str] = set()
    for run in order:
        if people[run] in seen:
            reasons[run] = ["a later run of the same participant"]
        seen.add(people[run])


def _drop_trials(
    experiment: Experiment, rows: pd.DataFrame
) -> tuple[pd.DataFrame, tuple[DroppedTrials, ...], list[str]]:
    dropped: list[DroppedTrials] = []
    missing: list[str] = []
    for rule in experiment.exclusions:
        if not isinstance(rule, LeavesOutTrials):
            continue
        if rule.needed not in rows.columns:
            missing.append(f"{rule.rule}: the data have no column '{rule.needed}'")
            continue
        bad = np.array([rule.drops(value) for value in rows[rule.needed].tolist()], dtype=bool)
        if bad.any():
            dropped.append(DroppedTrials(rule.rule, n_plays(rows[bad]), int(rows["run"][bad].nunique())))
        rows = rows[~bad]
    return rows, tuple(dropped), missing
