"""From a run's answers to signals of how they were given, and to one verdict by a table of points."""

import itertools
import json
import math
import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from operator import eq
from typing import Any, Literal

# Answers of any kind of trial as values that can be compared.


def comparable_answer(payload: Mapping[str, Any]) -> int | str | None:
    """A stored answer as one value, equal for equal answers; None where nothing was answered."""
    said = {name: _without_time(value) for name, value in payload.items() if value is not None}
    if said.keys() == {"response"}:
        return said["response"] if isinstance(said["response"], int) else str(said["response"])
    # Scales that were all left empty are nothing answered, though the payload itself is not empty.
    scales = payload.get("answers", {}).values()
    if scales and all(one["response"] is None and not one.get("not_applicable") for one in scales):
        return None
    # Sorted: equal answers must give equal texts, whatever the order of their keys.
    return json.dumps(said, sort_keys=True) if said else None


def _without_time(value: Any) -> Any:
    """An answer on several scales without the times that each took: equal answers must be equal."""
    if not isinstance(value, dict):
        return value
    return {name: {**one, "rt": None} if isinstance(one, dict) else one for name, one in value.items()}


# What a run's answers say about how they were given: one number per signal, None where it cannot be had.

# Patterns that fingers make are short; each further distance would be one more chance to fit by accident.
LONGEST_CYCLE = 4
MIN_FOR_SPREAD = 8
"""Answers from which on a spread or a pattern is reported."""
GUESSED_BY_CHANCE = 0.01
"""Motion checks are passed where guesses would be right as often with less than this probability."""
SEEN, POWER = 0.95, 0.99
"""Least share of motion checks that people see, and the probability that somebody who sees it passes."""


@dataclass(frozen=True)
class JudgedAnswer:
    """One answer with its evidence, as far as it brought any.

    Attributes
    ----------
    part : str
        `practice`, `main`, `attention` or `check`.
    expected : int or None
        What an attention check asked for, or what a motion check's clip shows.
    choices : int
        How many answers a motion or attention check offered.
    void : bool
        The check shows nothing, since its play failed or it was passed over.
    other_way : bool
        It was answered the way offered to those who cannot see it.
    needs_digest : bool
        It rated a clip.
    issued_at : datetime or None
        Of its ticket, None where it had none.
    press_ms : float or None
        Median length of its presses.
    """

    trial_index: int
    play: int
    part: str
    response: int | str | None
    expected: int | None
    rt: float | None
    clip_ms: float
    needs_digest: bool
    received_at: datetime
    issued_at: datetime | None = None
    digest_right: bool | None = None
    late: bool = False
    presses: int | None = None
    trusted: int | None = None
    press_ms: float | None = None
    choices: int = 0
    void: bool = False
    other_way: bool = False


@dataclass(frozen=True)
class Signals:
    """The signals of one run. Shares are from 0 to 1, times in milliseconds.

    Attributes
    ----------
    tickets : float or None
        Share of answers with a good ticket.
    digests : float or None
        Share of rated clips, of those that could be checked, whose digest was right.
    clip_time : float or None
        Length of the clips over the server's time from the first ticket to the last answer.
    claimed_time : float or None
        The same with the response times that the page claims added to the clips.
    order : float or None
        Share of first plays that came in the order of the trials.
    late : float or None
        Share of late deliveries.
    interaction : float or None
        Share of answers with a press reported.
    trusted : float or None
        Share of presses made by input, not by scripts.
    press_ms, press_spread : float or None
        Median and standard deviation of the presses' lengths.
    rt_median, rt_spread : float or None
        Median response time, standard deviation of its natural logarithm.
    same_answer : float or None
        Share of the most frequent answer.
    cycle : float or None
        Share of answers equal to the one some trials before, at the best distance from two to four.
    checks : float or None
        Share of attention checks answered correctly.
    motion_checks : float or None
        Share of motion checks answered rightly, of the `motion_checks_asked` that show something.
    motion_checks_guessed : float or None
        How likely guesses are right as often as that; None if too few were asked to distinguish guesses from
        people.
    motion_checks_other_way : float or None
        How many were answered the other way that the study offers.
    motion_checks_void : float or None
        How many show nothing, since their play failed or they were passed over.
    checks_guessed : float or None
        How likely guesses are right in as many of all checks, those of attention and of motion together;
        None where none was answered.
    """

    tickets: float | None = None
    digests: float | None = None
    clip_time: float | None = None
    claimed_time: float | None = None
    order: float | None = None
    late: float | None = None
    interaction: float | None = None
    trusted: float | None = None
    press_ms: float | None = None
    press_spread: float | None = None
    rt_median: float | None = None
    rt_spread: float | None = None
    same_answer: float | None = None
    cycle: float | None = None
    checks: float | None = None
    motion_checks: float | None = None
    motion_checks_asked: float | None = None
    motion_checks_guessed: float | None = None
    motion_checks_other_way: float | None = None
    motion_checks_void: float | None = None
    checks_guessed: float | None = None


SIGNAL_NAMES = tuple(field.name for field in fields(Signals))


# Decision 0420: Tickets are derived, and watching time is counted twice.
def signals_of(
    answers: Sequence[JudgedAnswer], passed_over: Sequence[int] = (), unstored_checks: Sequence[int] = ()
) -> Signals:
    """The signals of a run's answers, in any order.

    Parameters
    ----------
    passed_over : sequence of int, optional
        Choices of the checks without an answer.
    unstored_checks : sequence of int, optional
        Choices of the attention checks whose answer could not be stored: they count as wrong.
    """
    if not answers:
        return Signals()
    # The second key makes the result the same in whatever order the database gives answers of one moment.
    came = sorted(answers, key=lambda one: (one.received_at, one.trial_index))
    main = sorted((one for one in answers if one.part == "main"), key=lambda one: one.trial_index)
    responses = [one.response for one in main if one.response is not None]
    # Zero has no logarithm, and comes from a clock that stood still rather than from a person.
    times = [one.rt for one in main if one.rt is not None and one.rt > 0]
    lengths = [one.press_ms for one in answers if one.press_ms is not None]
    checks = [one for one in answers if one.part == "attention"]
    offered = [one for one in answers if one.part == "check"]
    asked = [one for one in offered if one.choices and not one.other_way]
    motion = [one for one in asked if not one.void]
    right = [one.response == one.expected for one in motion]
    clips = [one for one in answers if one.needs_digest]
    presses = sum(one.presses or 0 for one in answers)
    spread = len(times) >= MIN_FOR_SPREAD
    return Signals(
        tickets=_share([one.issued_at is not None for one in answers]),
        digests=_share([one.digest_right is True for one in clips]),
        clip_time=_of_time_there_was(came, sum(one.clip_ms for one in came)),
        claimed_time=_of_time_there_was(came, sum(one.clip_ms + (one.rt or 0.0) for one in came)),
        order=_order([one.trial_index for one in came if one.play == 1]),
        late=_share([one.late for one in answers]),
        interaction=_share([(one.presses or 0) > 0 for one in answers]),
        trusted=sum(one.trusted or 0 for one in answers) / presses if presses else None,
        press_ms=statistics.median(lengths) if lengths else None,
        press_spread=statistics.stdev(lengths) if len(lengths) >= MIN_FOR_SPREAD else None,
        rt_median=statistics.median(times) if times else None,
        rt_spread=statistics.stdev(map(math.log, times)) if spread else None,
        same_answer=_share_of_commonest(responses) if len(responses) >= MIN_FOR_SPREAD else None,
        cycle=_cycle(responses) if len(responses) >= 2 * MIN_FOR_SPREAD else None,
        checks=_share([*(one.response == one.expected for one in checks), *(False for _ in unstored_checks)]),
        motion_checks=_share(right),
        motion_checks_asked=len(motion) or None,
        motion_checks_guessed=chance_of_guessing(
            sum(right), [one.choices for one in motion], [*(one.choices for one in asked), *passed_over]
        ),
        motion_checks_other_way=sum(one.other_way for one in offered) if offered else None,
        motion_checks_void=len(asked) - len(motion) + len(passed_over) if offered or passed_over else None,
        checks_guessed=_guessed_together([*checks, *motion], unstored_checks),
    )


def _guessed_together(checks: Sequence[JudgedAnswer], wrong: Sequence[int]) -> float | None:
    weighed = [one for one in checks if one.choices > 1]
    # A check with one choice cannot be answered wrongly, and says nothing of guessing.
    choices = [*(one.choices for one in weighed), *(number for number in wrong if number > 1)]
    if not choices:
        return None
    right = sum(one.response == one.expected for one in weighed)
    return _at_least([1 / number for number in choices])[right]


def checks_tell(answers: Sequence[JudgedAnswer], passed_over: Sequence[int] = ()) -> bool:
    """Whether all motion checks asked, also void and skipped ones, can distinguish guesses from people."""
    # Void ones count too: a page that lets some checks fail must not change whether checks can decide.
    asked = [one.choices for one in answers if one.part == "check" and one.choices and not one.other_way]
    return _can_tell([*asked, *passed_over])


def chance_of_guessing(
    right: int, choices: Sequence[int], asked: Sequence[int] | None = None
) -> float | None:
    """How likely somebody who guesses is right at least `right` times; None where too few were asked.

    The number of right guesses is Poisson-binomial: check i is guessed with 1 / choices[i]. Enough are asked
    where somebody who sees `SEEN` of the checks passes (guesses do as well with less than
    `GUESSED_BY_CHANCE`) with at least `POWER`; whether they are follows from the choices of all that were
    `asked`, so that nobody gets around the checks by having one of them fail.
    """
    if not choices or not _can_tell(choices if asked is None else asked):
        return None
    return _at_least([1 / number for number in choices])[right]


def _can_tell(choices: Sequence[int]) -> bool:
    guesses = _at_least([1 / number for number in choices])
    # The fewest right answers that guesses reach too seldom; None where even all of them are not rare
    # enough.
    needed = next((number for number, chance in enumerate(guesses) if chance < GUESSED_BY_CHANCE), None)
    return needed is not None and _at_least([SEEN] * len(choices))[needed] >= POWER


def _at_least(chances: Sequence[float]) -> list[float]:
    """The probability of at least 0, 1, 2 ... hits where the i-th comes with chances[i]."""
    # One Bernoulli variable convolved in at a time: exact, and cheap for the few dozen checks of a visit.
    exactly = [1.0]
    for chance in chances:
        missed, hit = [*exactly, 0.0], [0.0, *exactly]
        exactly = [(1 - chance) * a + chance * b for a, b in zip(missed, hit, strict=True)]
    # The sum of all may exceed 1 by a rounding error.
    return [min(1.0, sum(exactly[number:])) for number in range(len(exactly))]


def _share(facts: Sequence[bool]) -> float | None:
    return sum(facts) / len(facts) if facts else None


def _of_time_there_was(came: Sequence[JudgedAnswer], claimed_ms: float) -> float | None:
    issued = [one.issued_at for one in came if one.issued_at is not None]
    # From the tickets on, not from the first answer: the first clip was shown before its answer came.
    there_was = (came[-1].received_at - min(issued)) / timedelta(milliseconds=1) if issued else 0.0
    return claimed_ms / there_was if there_was > 0 else None


def _order(indices: Sequence[int]) -> float | None:
    return _share([before < after for before, after in itertools.pairwise(indices)])


def _share_of_commonest(responses: Sequence[int | str]) -> float:
    return Counter(responses).most_common(1)[0][1] / len(responses)


def _cycle(responses: Sequence[int | str]) -> float:
    return max(
        float(sum(map(eq, responses, responses[lag:]))) / (len(responses) - lag)
        # Not 1: the same answer over and over is weighed by `same_answer`, and would be counted twice.
        for lag in range(2, LONGEST_CYCLE + 1)
    )


# From signals to one verdict per run, by a table of points; docs/explanation/evidence.md explains it.
#
# Points of all signals are added. From `LIKELY` on a run is `likely` a person's, up to `UNLIKELY` it is
# `unlikely`, between them `unclear`. A signal that cannot be had adds nothing, unless the table says so.
# Points alone never make a run `likely`: its attention and motion checks must be passed as well, since a
# browser that a script drives has every other signal of a person.

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
"""Share of motion checks that may show nothing, as plays fail on honest people's machines; one always may."""
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
    answers: Sequence[JudgedAnswer],
    *,
    refused: bool = False,
    passed_over: Sequence[int] = (),
    unstored_checks: Sequence[int] = (),
) -> Judgement:
    """The verdict on a run whose page was asked for evidence.

    Without passed checks the verdict is at most unclear. So it is where motion checks were answered the
    other way that the study offers, or too many of them show nothing; not so if they were too few to
    show anything.

    Parameters
    ----------
    refused : bool, optional
        Answers of the run were refused for their evidence, which happens to no page of this program.
    passed_over : sequence of int, optional
        Number of choices of each motion check that was left out.
    unstored_checks : sequence of int, optional
        Number of choices of each attention check whose answer could not be stored.
    """
    signals = signals_of(answers, passed_over, unstored_checks)
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
        The motion checks that were asked can distinguish guesses from people (`checks_tell`).
    """
    points = sum(points_of(name, getattr(signals, name)) for name in BANDS) + REFUSED_POINTS * refused
    if answers < MIN_ANSWERS:
        return ("unlikely" if refused else "unclear" if answers else "not_judged"), points
    if points <= UNLIKELY:
        return "unlikely", points
    doubted = signals.motion_checks_other_way or (_escapes_checks(signals) and tells)
    return ("likely" if points >= LIKELY and _passes_checks(signals) and not doubted else "unclear"), points


REASONS = {
    "tickets": "Answers came without valid tickets.",
    "digests": "The page did not show that it had fetched the clips.",
    "clip_time": "The clips are longer than the time in which they were answered.",
    "claimed_time": "Clips and response times are longer than the time in which they were answered.",
    "order": "The clips were not played in their order.",
    "interaction": "Most answers came without a key press or a click.",
    "trusted": "Key presses or clicks were made by a script, or are not known.",
    "press_ms": "Key presses and clicks had no duration, or their duration is not known.",
    "press_spread": "Every key or button was held for the same time.",
    "rt_median": "Half of the answers came within 0.2 s.",
    "rt_spread": "All answers took nearly the same time.",
    "same_answer": "Nearly all answers are the same.",
    "cycle": "The answers repeat in a fixed order.",
    "checks": "Most attention questions were answered wrong.",
    "motion_checks_guessed": "Motion checks were answered no better than by guessing.",
}
"""What speaks against a person, by the signal that takes points."""


def reasons_against(judged: Judgement, *, refused: bool) -> list[str]:
    """Why a run is not likely a person's, in sentences: the signals that took points, the heaviest first.

    >>> signals = Signals(trusted=1, press_ms=80, rt_spread=0.05, checks_guessed=0.01)
    >>> reasons_against(Judgement("unlikely", -5.0, signals), refused=False)
    ['All answers took nearly the same time.']
    """
    if judged.verdict in ("likely", "not_judged"):
        return []
    taken = {name: points_of(name, getattr(judged.signals, name)) for name in REASONS}
    reasons = [REASONS[name] for name in sorted(REASONS, key=lambda name: taken[name]) if taken[name] < 0]
    if refused:
        reasons.insert(0, "Answers were refused, because their evidence was wrong.")
    if not _passes_checks(judged.signals):
        reasons.append("Attention and motion checks do not show that a person answered.")
    return reasons


def _passes_checks(signals: Signals) -> bool:
    """Whether the run's attention and motion checks together are right more often than guesses."""
    return signals.checks_guessed is not None and signals.checks_guessed < ENOUGH_BY_CHANCE


def _escapes_checks(signals: Signals) -> bool:
    """Whether the run got around its motion checks: all of them show nothing, or more than may."""
    void, told = signals.motion_checks_void or 0, signals.motion_checks_asked or 0
    return void > max(1, VOID_SHARE * (void + told)) or (void > 0 and told == 0)
