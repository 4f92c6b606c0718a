"""Rules of [[exclusions]]: runs and single trials that are excluded from the analysis."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from statistics import median
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.declaration.base import Declaration
from experiments.rules.screening import failed_checks

# A rule of [[exclusions]] excludes whole runs or single trials, based on their data.
# A rule is a class: its keys, and a method that decides. The analysis calls it for every kind of trial.

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
    """A rule about runs: its method `excludes(run: RunTrials) -> str | None` says why, `reason()` what for.

    Attributes
    ----------
    needed : tuple of str
        Columns it reads; if the data lack one, the report states that the rule was not applied.
    source : {"rows", "plays", "attention"}
        All rows of the run, all main trials, or attention checks.
    """

    needed: ClassVar[tuple[str, ...]]
    source: ClassVar[Source] = "plays"


class LeavesOutTrials(Declaration):
    """A rule about single trials: its method `drops(value) -> bool` judges the trial's value in a column.

    Attributes
    ----------
    needed : str
        The column; if the data lack it, the report states that the rule was not applied.
    """

    needed: ClassVar[str]


class ScreensRaters(Declaration):
    """A rule that compares each run's ratings of clips with those of all other runs.

    The analysis computes it from the ratings of all runs, also of those that other rules exclude. It needs
    ratings on a scale.
    """

    needed: ClassVar[tuple[str, ...]] = ("response",)


# Trials excluded because their clip was not shown as declared.


class DropFailedPlays(LeavesOutTrials):
    """Exclude trials whose clip was not shown as declared (verdict failed)."""

    rule: Literal["failed_plays"] = "failed_plays"
    """The name of this rule."""
    needed: ClassVar[str] = "verdict"

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return "a clip that was not shown as declared"

    def drops(self, value: str | float) -> bool:
        """Whether a play failed."""
        return value == "failed"


# Trials excluded because the answer came late.


class DropSlowTrials(LeavesOutTrials):
    """Exclude trials answered later than `above_ms` after the end of the clip."""

    rule: Literal["slow_trials"] = "slow_trials"
    """The name of this rule."""
    above_ms: Annotated[float, Field(gt=0)] = 60_000.0
    """Response time above which a trial is excluded, in ms from the end of the clip."""
    needed: ClassVar[str] = "rt"

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return f"an answer more than {self.above_ms / 1000:g} s after the clip"

    def drops(self, value: str | float) -> bool:
        """Whether an answer came late."""
        return float(value) > self.above_ms


# Exclusion by failed attention checks.


class ExcludeAttention(LeavesOutRuns):
    """Exclude participants who failed more than `more_than` attention checks."""

    rule: Literal["attention_checks_failed"] = "attention_checks_failed"
    """The name of this rule."""
    more_than: Annotated[int, Field(ge=0)] = 0
    """Number of failed checks that is still allowed; 0 excludes at the first failure."""
    needed: ClassVar[tuple[str, ...]] = ("expected_response", "response")
    source: ClassVar[Source] = "attention"

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return failed_checks(self.more_than)

    def excludes(self, run: RunTrials) -> str | None:
        """How many checks were answered incorrectly, or not at all."""
        asked = zip(run.numbers("expected_response"), run.numbers("response"), strict=True)
        failed = sum(not isnan(expected) and given != expected for expected, given in asked)
        return f"{failed} failed" if failed > self.more_than else None


# Exclusion by the verdict on whether a person answered.

EvidenceVerdict = Literal["unlikely", "unclear", "not_judged"]


class ExcludeEvidence(LeavesOutRuns):
    """Exclude runs by the verdict on whether a person answered (docs/explanation/evidence.md)."""

    rule: Literal["evidence_verdict"] = "evidence_verdict"
    """The name of this rule."""
    verdicts: Annotated[tuple[EvidenceVerdict, ...], Field(min_length=1)] = ("unlikely",)
    """Verdicts that exclude a run. Runs with assistive technology can be `unclear`; runs without evidence are
    `not_judged`."""
    needed: ClassVar[tuple[str, ...]] = ("evidence_verdict",)
    source: ClassVar[Source] = "rows"

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        verdicts = " or ".join(verdict.replace("_", " ") for verdict in self.verdicts)
        return f"a verdict of {verdicts} on whether a person answered"

    def excludes(self, run: RunTrials) -> str | None:
        """The verdict."""
        verdict = run.texts("evidence_verdict")[0] or "not_judged"
        return verdict.replace("_", " ") if verdict in self.verdicts else None


# Exclusion by response time.


class ExcludeFast(LeavesOutRuns):
    """Exclude participants whose median response time is below `below_ms`."""

    rule: Literal["median_response_time"] = "median_response_time"
    """The name of this rule."""
    below_ms: Annotated[float, Field(gt=0)] = 200.0
    """Median response time below which a run is excluded, in ms from the end of the clip."""
    needed: ClassVar[tuple[str, ...]] = ("rt",)

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return f"a median response time below {self.below_ms:g} ms"

    def excludes(self, run: RunTrials) -> str | None:
        """The median response time."""
        times = run.given("rt")
        middle = median(times) if times else self.below_ms
        return f"median {middle:.0f} ms" if middle < self.below_ms else None


# Exclusion of participants who did not finish.


class ExcludeIncomplete(LeavesOutRuns):
    """Exclude participants who did not finish the run."""

    rule: Literal["incomplete"] = "incomplete"
    """The name of this rule."""
    needed: ClassVar[tuple[str, ...]] = ("run_status",)
    source: ClassVar[Source] = "rows"

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return "an unfinished visit"

    def excludes(self, run: RunTrials) -> str | None:
        """The state of a run that is not complete."""
        status = run.texts("run_status")[0]
        return None if status in {"complete", ""} else f"run is {status}"


# Exclusion by the share of plays that were flagged or failed.


class ExcludePlayback(LeavesOutRuns):
    """Exclude participants with more than this share of flagged or failed presentations."""

    rule: Literal["poor_playback_share"] = "poor_playback_share"
    """The name of this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Share of flagged or failed presentations above which a run is excluded, from 0 to 1."""
    needed: ClassVar[tuple[str, ...]] = ("verdict",)

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return f"more than {100 * self.more_than:g}% of clips not shown as declared"

    def excludes(self, run: RunTrials) -> str | None:
        """The share of poor presentations."""
        verdicts = run.texts("verdict")
        share = sum(verdict in {"flagged", "failed"} for verdict in verdicts) / len(verdicts)
        return f"{share:.0%} of plays were flagged or failed" if share > self.more_than else None


# Exclusion by identical answers.


class ExcludeStraightLining(LeavesOutRuns):
    """Exclude participants who gave the same answer in more than this share of trials."""

    rule: Literal["same_response_share"] = "same_response_share"
    """The name of this rule."""
    more_than: Annotated[float, Field(ge=0, le=1)] = 0.95
    """Share of trials with the most frequent answer above which a run is excluded, from 0 to 1."""
    needed: ClassVar[tuple[str, ...]] = ("response",)

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return f"the same answer in more than {100 * self.more_than:g}% of trials"

    def excludes(self, run: RunTrials) -> str | None:
        """The share of the most frequent answer."""
        given = run.given("response")
        share = max(Counter(given).values(), default=0) / max(1, len(given))
        return f"{share:.0%} of answers are the same" if share > self.more_than else None


# Screening of raters as the standards of the ITU declare it.


class ScreenByBT500(ScreensRaters):
    """Exclude raters by ITU-R BT.500: too many ratings far from the mean, above and below alike."""

    rule: Literal["bt500"] = "bt500"
    """The name of this rule."""

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return "ratings far from the mean, above and below alike (ITU-R BT.500)"


class ScreenByP913(ScreensRaters):
    """Exclude raters by ITU-T P.913: a low correlation with the mean ratings, the lowest first."""

    rule: Literal["p913"] = "p913"
    """The name of this rule."""
    below: Annotated[float, Field(gt=0, lt=1)] = 0.75
    """Correlation with the mean ratings of clips below which a rater is excluded."""

    def reason(self) -> str:
        """The reason in words, for a Methods section."""
        return f"a correlation below {self.below:g} with the mean ratings of clips (ITU-T P.913)"
