"""Rules of [[exclusions]]: runs and single trials that are left out when a study is analysed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from statistics import median
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.declaration.base import Declaration

# What a rule of [[exclusions]] is: it leaves out whole runs, or single trials, by the data they gave.
#
# A rule is one file: its keys, and a method that judges. The analysis asks it, whatever the kind of trial.

Source = Literal["rows", "plays", "attention"]


@dataclass(frozen=True)
class RunTrials:
    """Columns of one run's trials: text, and numbers with NaN where there is none.

    `response` is the answer as a number, whatever the kind of trial: the point of a scale, or the number of
    the answer's key.
    """

    columns: Mapping[str, Sequence[str] | Sequence[float]]

    def texts(self, name: str) -> list[str]:
        """Every value of a column of text."""
        return [str(value) for value in self.columns[name]]

    def numbers(self, name: str) -> list[float]:
        """Every value of a column of numbers, NaN included."""
        return [float(value) for value in self.columns[name]]

    def given(self, name: str) -> list[float]:
        """The numbers there are in a column."""
        return [value for value in self.numbers(name) if not isnan(value)]


# Decision 0510: An exclusion rule is one file.
class LeavesOutRuns(Declaration):
    """A rule about runs: its method `excludes(run: RunTrials) -> str | None` gives the reason in words.

    Attributes
    ----------
    needed : tuple of str
        Columns it reads; where the data lack one the report says that the rule was not applied.
    source : {"rows", "plays", "attention"}
        All rows of the run, main trials of which nothing is left out, or attention checks.
    """

    needed: ClassVar[tuple[str, ...]]
    source: ClassVar[Source] = "plays"


class LeavesOutTrials(Declaration):
    """A rule about single trials: its method `drops(value) -> bool` judges the trial's value in a column.

    Attributes
    ----------
    needed : str
        The column; where the data lack it the report says that the rule was not applied.
    """

    needed: ClassVar[str]


# Trials left out because their clip was not shown as declared.


class DropFailedPlays(LeavesOutTrials):
    """Leave out trials whose clip was not shown as declared (verdict failed)."""

    rule: Literal["failed_plays"] = "failed_plays"
    """Names this rule."""
    needed: ClassVar[str] = "verdict"

    def drops(self, value: str | float) -> bool:
        """Whether a play failed."""
        return value == "failed"


# Trials left out because the answer came late.


class DropSlowTrials(LeavesOutTrials):
    """Leave out trials answered later than `above_ms` after the clip's end."""

    rule: Literal["slow_trials"] = "slow_trials"
    """Names this rule."""
    above_ms: Annotated[float, Field(gt=0)] = 60_000.0
    """Response time, in ms from the clip's end, over which a trial is left out."""
    needed: ClassVar[str] = "rt"

    def drops(self, value: str | float) -> bool:
        """Whether an answer came late."""
        return float(value) > self.above_ms


# Exclusion by failed attention checks.


class ExcludeAttention(LeavesOutRuns):
    """Leave out participants who failed more than `more_than` attention checks."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    """Names this rule."""
    more_than: Annotated[int, Field(ge=0)] = 0
    """Failed checks that are still allowed; 0 excludes at the first."""
    needed: ClassVar[tuple[str, ...]] = ("expected_response", "response")
    source: ClassVar[Source] = "attention"

    def excludes(self, run: RunTrials) -> str | None:
        """How many checks were answered otherwise than asked, or not at all."""
        asked = zip(run.numbers("expected_response"), run.numbers("response"), strict=True)
        failed = sum(not isnan(expected) and given != expected for expected, given in asked)
        return f"{failed} failed" if failed > self.more_than else None


# Exclusion by the verdict on whether a person answered.

EvidenceVerdict = Literal["unlikely", "unclear", "not_judged"]


class ExcludeEvidence(LeavesOutRuns):
    """Leave out runs by the verdict on whether a person answered (docs/explanation/evidence.md)."""

    rule: Literal["evidence_verdict"] = "evidence_verdict"
    """Names this rule."""
    verdicts: Annotated[tuple[EvidenceVerdict, ...], Field(min_length=1)] = ("unlikely",)
    """Verdicts that leave a run out. Assistive technology can be `unclear`; runs of pages that brought no
    evidence are `not_judged`."""
    needed: ClassVar[tuple[str, ...]] = ("evidence_verdict",)
    source: ClassVar[Source] = "rows"

    def excludes(self, run: RunTrials) -> str | None:
        """The verdict."""
        verdict = run.texts("evidence_verdict")[0] or "not_judged"
        return verdict.replace("_", " ") if verdict in self.verdicts else None


# Exclusion by response time.


class ExcludeFast(LeavesOutRuns):
    """Leave out participants whose median response time lies below `below_ms`."""

    rule: Literal["median_response_time"] = "median_response_time"
    """Names this rule."""
    below_ms: Annotated[float, Field(gt=0)] = 200.0
    """Median response time, in ms from the clip's end, under which a run is left out."""
    needed: ClassVar[tuple[str, ...]] = ("rt",)

    def excludes(self, run: RunTrials) -> str | None:
        """The median response time."""
        times = run.given("rt")
        middle = median(times) if times else self.below_ms
        return f"median {middle:.0f} ms" if middle < self.below_ms else None


# Exclusion of participants who did not finish.


class ExcludeIncomplete(LeavesOutRuns):
    """Leave out participants who did not finish the run."""

    rule: Literal["incomplete"] = "incomplete"
    """Names this rule."""
    needed: ClassVar[tuple[str, ...]] = ("run_status",)
    source: ClassVar[Source] = "rows"

    def excludes(self, run: RunTrials) -> str | None:
        """The state of a run that is not complete."""
        status = run.texts("run_status")[0]
        return None if status in {"complete", ""} else f"run is {status}"


# Exclusion by the share of plays that were flagged or failed.


class ExcludePlayback(LeavesOutRuns):
    """Leave out participants with more than this share of plays that were flagged or failed."""

    rule: Literal["poor_playback_share"] = "poor_playback_share"
    """Names this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Share of plays, flagged or failed, from 0 to 1, over which a run is left out."""
    needed: ClassVar[tuple[str, ...]] = ("verdict",)

    def excludes(self, run: RunTrials) -> str | None:
        """The share of poor plays."""
        verdicts = run.texts("verdict")
        share = sum(verdict in {"flagged", "failed"} for verdict in verdicts) / len(verdicts)
        return f"{share:.0%} of plays were flagged or failed" if share > self.more_than else None


# Exclusion by one and the same answer.


class ExcludeStraightLining(LeavesOutRuns):
    """Leave out participants who gave one and the same answer in more than this share of trials."""

    rule: Literal["same_response_share"] = "same_response_share"
    """Names this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.95
    """Share of trials with the commonest answer, from 0 to 1, over which a run is left out."""
    needed: ClassVar[tuple[str, ...]] = ("response",)

    def excludes(self, run: RunTrials) -> str | None:
        """The share of the commonest answer."""
        given = run.given("response")
        share = max(Counter(given).values(), default=0) / max(1, len(given))
        return f"{share:.0%} of answers are the same" if share > self.more_than else None
