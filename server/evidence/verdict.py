"""From signals to one verdict a run, by a table of points; docs/evidence.md says how they were set.

Points of all signals are added. From `LIKELY` on a run is `likely` a person's, up to `UNLIKELY` it is
`unlikely`, between them `unclear`. A signal that cannot be had adds nothing, unless the table says so.
Points alone never make a run `likely`: its attention and motion checks must be passed as well, since a
browser that a script drives has every other signal of a person.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from server.evidence.signals import GUESSED_BY_CHANCE, JudgedAnswer, Signals, checks_tell, signals_of

Verdict = Literal["likely", "unclear", "unlikely", "not_judged"]
VERDICTS: tuple[Verdict, ...] = ("likely", "unclear", "unlikely", "not_judged")
LIKELY, UNLIKELY = 7.0, 0.0
MIN_ANSWERS = 6
"""Runs with fewer answers are unclear: there is not enough to judge by."""


@dataclass(frozen=True)
class Band:
    """Points of one signal within a range: `low` <= value < `high`."""

    low: float
    high: float
    points: float


INFINITE = float("inf")
BANDS: dict[str, tuple[Band, ...]] = {
    "tickets": (Band(0, 1, -3), Band(1, INFINITE, 1)),
    "digests": (Band(0, 1, -4), Band(1, INFINITE, 1)),
    "clip_time": (Band(1.05, INFINITE, -4),),
    "claimed_time": (Band(1.05, INFINITE, -4),),
    "order": (Band(0, 0.8, -2),),
    "interaction": (Band(0, 0.5, -3), Band(0.9, INFINITE, 1)),
    "trusted": (Band(0, 0.5, -2), Band(0.9, INFINITE, 2)),
    "press_ms": (Band(0, 25, -2),),
    "press_spread": (Band(0, 2, -3),),
    "rt_median": (Band(0, 200, -2), Band(300, INFINITE, 1)),
    "rt_spread": (Band(0, 0.1, -3), Band(0.12, INFINITE, 1)),
    "same_answer": (Band(0.95, INFINITE, -1.5),),
    "cycle": (Band(0.9, INFINITE, -2),),
    "checks": (Band(0, 0.5, -2), Band(1, INFINITE, 1)),
    "motion_checks_guessed": (Band(0, GUESSED_BY_CHANCE, 1), Band(GUESSED_BY_CHANCE, INFINITE, -4)),
}
"""Points of each signal; a value in none of its bands adds nothing. `late` is shown and adds nothing, as are
`motion_checks` and its numbers: the same share says more or less by how many checks and choices there were,
which `motion_checks_guessed` weighs. The lengths of presses only take points: other work on a machine
lengthens and varies the presses that a script makes, so that usual lengths are evidence of nothing.
`checks_guessed` adds nothing either; no run is `likely` without it."""
ENOUGH_BY_CHANCE = 0.05
"""A run can be `likely` where guesses do as well in all its checks together with less than this probability.

With one attention question of seven answers and two motion checks of nine choices, two of the three must be
right: so they are for 99.7 % of those who read the question and see 95 % of such clips (`SEEN`).
"""
VOID_SHARE = 0.2
"""Share of motion checks that may tell nothing, as plays fail on honest people's machines; one may always."""
REFUSED_POINTS = -4.0
"""Points where answers of the run were refused for their evidence."""
WITHOUT: dict[str, float] = {"trusted": -1, "press_ms": -2}
"""Points where a signal cannot be had that every page reports."""


@dataclass(frozen=True)
class Judgement:
    """The verdict on a run, the points it rests on, and the signals."""

    verdict: Verdict
    points: float
    signals: Signals


NOT_JUDGED = Judgement("not_judged", 0.0, Signals())


def points_of(name: str, value: float | None) -> float:
    """Points that this value of a signal adds."""
    if value is None:
        return WITHOUT.get(name, 0.0)
    return next((band.points for band in BANDS.get(name, ()) if band.low <= value < band.high), 0.0)


def judge(
    answers: Sequence[JudgedAnswer], *, refused: bool = False, passed_over: Sequence[int] = ()
) -> Judgement:
    """The verdict on a run whose page was asked for evidence.

    Without passed checks the verdict is at most unclear. So it is where motion checks were answered the
    other way that the study offers, or too many of them tell nothing; not so where they were too few to
    tell anything.

    Parameters
    ----------
    refused : bool, optional
        Answers of the run were refused for their evidence, which happens to no page of this program.
    passed_over : sequence of int, optional
        Number of choices of each motion check that was left out.
    """
    signals = signals_of(answers, passed_over)
    tells = checks_tell(answers, passed_over)
    verdict, points = verdict_on(signals, answers=len(answers), refused=refused, tells=tells)
    return Judgement(verdict, points, signals)


def verdict_on(signals: Signals, *, answers: int, refused: bool, tells: bool) -> tuple[Verdict, float]:
    """The verdict on a run with these signals, and its points.

    Parameters
    ----------
    answers : int
        How many answers the run has.
    tells : bool
        The motion checks that were asked can tell guesses from people (`checks_tell`).
    """
    points = sum(points_of(name, getattr(signals, name)) for name in BANDS) + REFUSED_POINTS * refused
    if answers < MIN_ANSWERS:
        return ("unlikely" if refused else "unclear" if answers else "not_judged"), points
    if points <= UNLIKELY:
        return "unlikely", points
    doubted = signals.motion_checks_other_way or (_escapes(signals) and tells)
    return ("likely" if points >= LIKELY and _passes(signals) and not doubted else "unclear"), points


def _passes(signals: Signals) -> bool:
    """Whether the run's attention and motion checks together are right more often than guesses."""
    return signals.checks_guessed is not None and signals.checks_guessed < ENOUGH_BY_CHANCE


def _escapes(signals: Signals) -> bool:
    """Whether the run got around its motion checks: all of them tell nothing, or more than may."""
    void, told = signals.motion_checks_void or 0, signals.motion_checks_asked or 0
    return void > max(1, VOID_SHARE * (void + told)) or (void > 0 and told == 0)
