"""Apply the exclusion rules an experiment declared before its data; every one named with its reason."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import assert_never

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.study_answers import StudyAnswers
from analysis.read.text_table import flags
from analysis.votes import Screening, screen_raters
from experiments import rules
from experiments.declaration.experiment import Experiment
from experiments.kinds import scales_of
from experiments.rules.exclusions import LeavesOutRuns, LeavesOutTrials, RunTrials, ScreensRaters, Source
from table_files import counted


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


@dataclass(frozen=True)
class RuleVerdicts:
    """What every declared rule says of a study's rows; any choice among the rules is then quickly applied.

    Attributes
    ----------
    people : dict
        Participant of every run.
    by_hand : tuple of (str, str)
        Runs excluded by hand, and why; whatever the choice, they are left out.
    runs : tuple of tuple of (str, str), one per rule
        Runs that the rule leaves out, and why; empty for a rule about trials.
    trials : tuple of (n,) bool arrays, one per rule
        Rated main trials that the rule leaves out; None for a rule about runs.
    lacking : tuple of str, one per rule
        Why the rule cannot be applied; empty where it can.
    main : DataFrame
        The n rated main trials.
    """

    rules: tuple[rules.ExclusionRule, ...]
    people: dict[str, str]
    by_hand: tuple[tuple[str, str], ...]
    runs: tuple[tuple[tuple[str, str], ...], ...]
    trials: tuple[NDArray[np.bool_] | None, ...]
    lacking: tuple[str, ...]
    set_aside: tuple[str, ...]
    first_seen: Mapping[str, str]
    main: pd.DataFrame = field(repr=False)

    def under(self, chosen: Sequence[bool]) -> Exclusions:
        """Apply the chosen rules, one truth value per declared rule."""
        at = [rule for rule, applies in enumerate(chosen) if applies]
        reasons: dict[str, list[str]] = {}
        # A run may break several rules; all reasons are named.
        for run, why in (*self.by_hand, *(said for rule in at for said in self.runs[rule])):
            reasons.setdefault(run, []).append(why)
        # After the other rules: where one of them excludes a first run, the second counts as the first.
        _later_runs(self.people, reasons, self.first_seen, frozenset(map(str, self.main["run"].unique())))
        excluded = tuple(
            ExcludedRun(str(self.people[run]), str(run), tuple(reasons[run]))
            for run in sorted(reasons)
            # Without any rated trial `people` is empty.
            if run in self.people
        )
        kept = ~self.main["run"].isin(list(reasons)).to_numpy()
        dropped: list[DroppedTrials] = []
        for rule in at:
            marked = self.trials[rule]
            if marked is None:
                continue
            # Trials that a rule before has left out are not counted again.
            bad = kept & marked
            if bad.any():
                runs = int(self.main["run"][bad].nunique())
                dropped.append(DroppedTrials(self.rules[rule].rule, n_plays(self.main[bad]), runs))
            # In declared order: each rule counts what those before it left.
            kept &= ~marked
        # Rules about participants first, then those about trials, in the order of their use.
        order = sorted(at, key=lambda rule: isinstance(self.rules[rule], LeavesOutTrials))
        missing = tuple(self.lacking[rule] for rule in order if self.lacking[rule])
        n_runs = len(self.people)
        return Exclusions(excluded, tuple(dropped), self.set_aside, missing, n_runs, self.main[kept])


def apply_exclusions(experiment: Experiment, ratings: StudyAnswers) -> Exclusions:
    """Set aside everything but main trials, then apply every declared rule.

    Rules about participants see all their main trials; rules about trials see those of the
    remaining participants. A participant's second run is left out, the first that no rule excludes counts.
    """
    return judge_rows(experiment, ratings).under([True] * len(experiment.exclusions))


def judge_rows(experiment: Experiment, ratings: StudyAnswers) -> RuleVerdicts:
    """Set aside everything but main trials, and apply every declared rule to them."""
    rows, aside = _with_run(ratings.rows), list[str]()
    # A table of others has no kinds: all its rows are main trials.
    kind = rows["kind"] if "kind" in rows.columns else pd.Series("main", index=rows.index)
    main, attention = rows[(kind == "main").to_numpy()], rows[(kind == "attention").to_numpy()]
    # Whatever is none of the three counts as practice.
    practice = n_plays(rows[~kind.isin(["main", "attention", "check"]).to_numpy()])
    checks = n_plays(rows[(kind == "check").to_numpy()])
    aside += [counted(practice, "practice trial")] if practice else []
    aside += [counted(checks, "motion check")] if checks else []
    unrated = np.isnan(main["response"].to_numpy())
    # An answer, not a missing one, and named apart.
    not_applicable = unrated & _not_applicable(main)
    silent = n_plays(main[unrated & ~not_applicable])
    aside += [counted(silent, "presentation") + " without a rating"] if silent else []
    aside += [counted(int(not_applicable.sum()), "answer") + " of 'does not apply'"] * bool(
        not_applicable.any()
    )
    # Some rules count plays without an answer, so these are kept for them.
    plays, main = main, main[~unrated]
    sources: dict[Source, pd.DataFrame] = {"rows": rows, "plays": plays, "attention": attention}
    lacking = tuple(_lacking(rule, rows, experiment) for rule in experiment.exclusions)
    usable = list(zip(experiment.exclusions, lacking, strict=True))
    return RuleVerdicts(
        rules=tuple(experiment.exclusions),
        people=_people(main, rows),
        by_hand=tuple(_by_hand(rows)),
        runs=tuple(
            () if without else _runs_left_out(rule, sources, experiment.factor_names)
            for rule, without in usable
        ),
        trials=tuple(None if without else _trials_left_out(rule, main) for rule, without in usable),
        lacking=lacking,
        set_aside=tuple(aside),
        first_seen=ratings.first_seen,
        main=main,
    )


def n_plays(rows: pd.DataFrame) -> int:
    """Number of presentations: one that was rated on several scales has one row per scale."""
    keys = [name for name in ("run", "trial_index", "play") if name in rows.columns]
    # A table without trial numbers cannot show which rows are of one play.
    if "scale" not in rows.columns or "trial_index" not in keys:
        return len(rows)
    return int((~rows.duplicated(keys)).sum())


def _not_applicable(rows: pd.DataFrame) -> NDArray[np.bool_]:
    """True where the participant chose that the scale does not apply."""
    if "not_applicable" not in rows.columns:
        return np.zeros(len(rows), dtype=bool)
    return flags(rows["not_applicable"], "the table")


def _with_run(rows: pd.DataFrame) -> pd.DataFrame:
    # Where a table names no runs, every participant has one.
    return rows if "run" in rows.columns else rows.assign(run=rows["participant"])


def _people(main: pd.DataFrame, rows: pd.DataFrame) -> dict[str, str]:
    """Participant of every run."""
    pairs = rows[["run", "participant"]].drop_duplicates()
    return (
        {str(run): str(participant) for run, participant in pairs.itertuples(index=False)}
        # Without a rated trial nobody is counted.
        if len(main)
        else {}
    )


def _lacking(rule: rules.ExclusionRule, rows: pd.DataFrame, experiment: Experiment) -> str:
    """Why a rule cannot be applied to these columns, or nothing."""
    needed: tuple[str, ...] = ()
    if isinstance(rule, LeavesOutRuns):
        needed = rule.needed
    elif isinstance(rule, ScreensRaters):
        # Screening compares ratings, which choices are not.
        if not scales_of(experiment):
            return f"{rule.rule}: trials of this kind have no ratings on a scale"
        needed = (*rule.needed, *experiment.factor_names)
    elif isinstance(rule, LeavesOutTrials):
        needed = (rule.needed,)
    missing = next((name for name in needed if name not in rows.columns), None)
    return "" if missing is None else f"{rule.rule}: the data have no column '{missing}'"


def _runs_left_out(
    rule: rules.ExclusionRule, sources: Mapping[Source, pd.DataFrame], factors: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    if isinstance(rule, ScreensRaters):
        return _screened(rule, sources["plays"], factors)
    if not isinstance(rule, LeavesOutRuns):
        return ()
    said = ((run, _why(rule, trials)) for run, trials in _by_run(sources[rule.source], rule.needed))
    return tuple((run, f"{rule.rule}: {reason}") for run, reason in said if reason is not None)


def _screened(
    rule: rules.ScreenByBT500 | rules.ScreenByP913, plays: pd.DataFrame, factors: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    """Runs whose ratings are unlike those of all others; a clip's ratings on a scale are averaged."""
    # What makes two ratings comparable: the same clip on the same scale.
    clip = [name for name in (*factors, "exemplar", "scale") if name in plays.columns]
    rated = plays[np.isfinite(plays["response"].to_numpy())]
    if rated.empty:
        return ()
    means = rated.groupby(["run", *clip], observed=True)["response"].mean()
    # One row per run, one column per clip; NaN where a run has no rating.
    table = means.unstack(clip)
    screening: Screening = {"rule": rule.rule, "below": getattr(rule, "below", 0.0)}
    reasons = screen_raters(table.to_numpy(dtype=np.float64), screening)
    return tuple((str(table.index[run]), f"{rule.rule}: {why}") for run, why in reasons.items())


def _trials_left_out(rule: rules.ExclusionRule, main: pd.DataFrame) -> NDArray[np.bool_] | None:
    if not isinstance(rule, LeavesOutTrials):
        return None
    return np.array([rule.drops(value) for value in main[rule.needed].tolist()], dtype=bool)


def _by_run(rows: pd.DataFrame, names: tuple[str, ...]) -> Iterator[tuple[str, RunTrials]]:
    """Each run's values of some columns."""
    values = {name: rows[name].to_numpy() for name in names}
    for run, places in rows.groupby("run", observed=True).indices.items():
        yield str(run), RunTrials({name: column[places].tolist() for name, column in values.items()})


def _why(rule: rules.ExclusionRule, trials: RunTrials) -> str | None:
    """The rule's own word on a run; a rule that is of neither sort, or has no method, fails type-checking."""
    if isinstance(rule, LeavesOutRuns):
        return rule.excludes(trials)
    if isinstance(rule, LeavesOutTrials | ScreensRaters):
        return None
    assert_never(rule)


def _by_hand(rows: pd.DataFrame) -> list[tuple[str, str]]:
    if "excluded" not in rows.columns:
        return []
    # The export repeats the mark on every row of a run.
    chosen = rows[rows["excluded"].to_numpy()].drop_duplicates("run")
    given = chosen["exclusion_reason"] if "exclusion_reason" in chosen.columns else [""] * len(chosen)
    return [
        (str(run), f"by hand: {why or 'no reason given'}")
        for run, why in zip(chosen["run"], given, strict=True)
    ]


def _later_runs(
    people: Mapping[str, str],
    reasons: dict[str, list[str]],
    first_seen: Mapping[str, str],
    rated: Set[str],
) -> None:
    """Keep the first `rated` run of each participant among those that no rule excludes.

    A run that ended in the practice says nothing, and must not take the place of one that has answers.
    """
    # Without a time the name of a run decides, so that the result is the same each time.
    order = sorted(
        (run for run in people if run in rated and run not in reasons),
        key=lambda run: (first_seen.get(run, ""), run),
    )
    seen: set[str] = set()
    for run in order:
        if people[run] in seen:
            reasons[run] = ["a later run of the same participant"]
        seen.add(people[run])
