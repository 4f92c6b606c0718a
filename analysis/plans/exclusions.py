"""Apply the exclusion rules an experiment declared before its data; every one named with its reason."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Literal, assert_never

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.study_ratings import StudyRatings
from experiments import rules
from experiments.definition import Experiment

Mask = NDArray[np.bool_]


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


def apply_exclusions(experiment: Experiment, ratings: StudyRatings) -> Exclusions:
    """Set aside what is no main trial, then apply every declared rule.

    Rules about participants see all their main trials; rules about trials see those of who remains. A
    participant's second run is left out, the first that no rule excludes counts.
    """
    rows, aside = _with_run(ratings.rows), list[str]()
    kind = rows["kind"] if "kind" in rows.columns else pd.Series("main", index=rows.index)
    main, attention = rows[(kind == "main").to_numpy()], rows[(kind == "attention").to_numpy()]
    practice = len(rows) - len(main) - len(attention)
    aside += [f"{practice} practice trials"] if practice else []
    unrated = np.isnan(main["response"].to_numpy())
    aside += [f"{unrated.sum()} plays without a rating"] if unrated.any() else []
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
    for rule in experiment.exclusions:
        finder = _finder(rule)
        if isinstance(finder, _OfTrials):
            continue
        if finder.needed not in rows.columns:
            not_applied.append(f"{rule.rule}: the data have no column '{finder.needed}'")
            continue
        source = {"rows": rows, "plays": plays, "attention": attention}[finder.source]
        for run, why in finder.find(source):
            reasons.setdefault(run, []).append(f"{rule.rule}: {why}")
    return reasons, not_applied


def _by_hand(rows: pd.DataFrame) -> list[tuple[str, str]]:
    if "excluded" not in rows.columns:
        return []
    chosen = rows[rows["excluded"].to_numpy()].drop_duplicates("run")
    given = chosen["exclusion_reason"] if "exclusion_reason" in chosen.columns else [""] * len(chosen)
    return [
        (str(run), f"by hand: {why or 'no reason given'}")
        for run, why in zip(chosen["run"], given, strict=True)
    ]


Finding = list[tuple[str, str]]


def _incomplete(_: rules.ExcludeIncomplete, rows: pd.DataFrame) -> Finding:
    runs = rows[["run", "run_status"]].drop_duplicates()
    return [
        (str(run), f"run is {status}")
        for run, status in runs.itertuples(index=False)
        if status not in {"complete", ""}
    ]


def _attention(rule: rules.ExcludeAttention, rows: pd.DataFrame) -> Finding:
    asked = rows[~np.isnan(rows["expected_response"].to_numpy())]
    failed = asked[(asked["response"] != asked["expected_response"]).to_numpy()]
    counts = failed["run"].value_counts()
    return [(str(run), f"{n} failed") for run, n in counts.items() if n > rule.more_than]


def _playback(rule: rules.ExcludePlayback, rows: pd.DataFrame) -> Finding:
    poor = rows["verdict"].isin(["flagged", "failed"]).to_numpy()
    shares = pd.Series(poor, index=rows.index).groupby(rows["run"], observed=True).mean()
    return [
        (str(run), f"{share:.0%} of plays were flagged or failed")
        for run, share in shares.items()
        if share > rule.more_than
    ]


def _straight(rule: rules.ExcludeStraightLining, rows: pd.DataFrame) -> Finding:
    counts = rows.groupby(["run", "response"], observed=True).size().groupby(level=0, observed=True)
    share = counts.max() / counts.sum()
    return [(str(run), f"{s:.0%} of answers are the same") for run, s in share.items() if s > rule.more_than]


def _fast(rule: rules.ExcludeFast, rows: pd.DataFrame) -> Finding:
    medians = rows["rt"].groupby(rows["run"], observed=True).median()
    return [(str(run), f"median {rt:.0f} ms") for run, rt in medians.items() if rt < rule.below_ms]


@dataclass(frozen=True)
class _OfRuns:
    """Finds runs to leave out among all rows, main plays or attention checks; needs one column for it."""

    needed: str
    source: Literal["rows", "plays", "attention"]
    find: Callable[[pd.DataFrame], Finding]


@dataclass(frozen=True)
class _OfTrials:
    """Finds trials to leave out among those that remain; needs one column for it."""

    needed: str
    find: Callable[[pd.DataFrame], Mask]


def _finder(rule: rules.ExclusionRule) -> _OfRuns | _OfTrials:
    match rule:
        case rules.ExcludeIncomplete():
            return _OfRuns("run_status", "rows", partial(_incomplete, rule))
        case rules.ExcludeAttention():
            return _OfRuns("expected_response", "attention", partial(_attention, rule))
        case rules.ExcludePlayback():
            return _OfRuns("verdict", "plays", partial(_playback, rule))
        case rules.ExcludeStraightLining():
            return _OfRuns("response", "plays", partial(_straight, rule))
        case rules.ExcludeFast():
            return _OfRuns("rt", "plays", partial(_fast, rule))
        case rules.DropFailedPlays():
            return _OfTrials("verdict", _failed)
        case rules.DropSlowTrials():
            return _OfTrials("rt", partial(_slow, rule))
        case _:
            assert_never(rule)


def _later_runs(people: dict[str, str], reasons: dict[str, list[str]], ratings: StudyRatings) -> None:
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
        finder = _finder(rule)
        if isinstance(finder, _OfRuns):
            continue
        if finder.needed not in rows.columns:
            missing.append(f"{rule.rule}: the data have no column '{finder.needed}'")
            continue
        bad = finder.find(rows)
        if bad.any():
            dropped.append(DroppedTrials(rule.rule, int(bad.sum()), int(rows["run"][bad].nunique())))
        rows = rows[~bad]
    return rows, tuple(dropped), missing


def _failed(rows: pd.DataFrame) -> Mask:
    return (rows["verdict"] == "failed").to_numpy()


def _slow(rule: rules.DropSlowTrials, rows: pd.DataFrame) -> Mask:
    return (rows["rt"] > rule.above_ms).to_numpy()
