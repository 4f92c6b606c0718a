"""What motion checks add to the verdict on a run."""

import random
from collections import Counter
from dataclasses import replace
from math import comb
from typing import Any

import pytest

from server.participation.evidence import JudgedAnswer, chance_of_guessing, judge, signals_of
from tests.server.evidence.test_verdicts import gamma_person

CHECKS, CHOICES, RUNS = 10, 4, 1000


def with_checks(answers: list[JudgedAnswer], rng: random.Random, right: float) -> list[JudgedAnswer]:
    """A run with ten of its trials turned into motion checks, answered rightly with this probability."""
    made = list(answers)
    for index in range(0, 50, 5):
        shown = rng.randint(1, CHOICES)
        wrong = rng.choice([one for one in range(1, CHOICES + 1) if one != shown])
        given = shown if rng.random() < right else wrong
        made[index] = replace(made[index], part="check", choices=CHOICES, expected=shown, response=given)
    return made


def test_guesses_are_counted_as_the_binomial_distribution_has_them() -> None:
    expected = sum(comb(10, k) * 0.25**k * 0.75 ** (10 - k) for k in range(6, 11))
    assert chance_of_guessing(6, [4] * 10) == pytest.approx(expected)
    assert chance_of_guessing(0, [4] * 10) == pytest.approx(1)
    assert chance_of_guessing(10, [9] * 4 + [4] * 6) == pytest.approx(9**-4 * 4**-6)


def test_too_few_checks_say_nothing() -> None:
    """Where one lapse would make somebody who sees them look like a guess."""
    enough = {9: 6, 4: 8, 2: 20}
    assert chance_of_guessing(0, []) is None
    for choices, number in enough.items():
        assert chance_of_guessing(number, [choices] * number) is not None
    assert chance_of_guessing(4, [9] * 4) is None
    assert chance_of_guessing(5, [4] * 5) is None
    assert chance_of_guessing(10, [2] * 10) is None


@pytest.mark.parametrize("choices", [4, 9])
def test_guessing_passes_ten_checks_less_than_once_in_a_hundred_runs(choices: int) -> None:
    """By the distribution itself: the chance to reach the least number of right answers that passes."""
    passes = next(n for n in range(CHECKS + 1) if (chance_of_guessing(n, [choices] * CHECKS) or 0) < 0.01)
    chance = chance_of_guessing(passes, [choices] * CHECKS)
    assert chance is not None
    assert chance < 0.01


def test_somebody_who_guesses_is_not_likely_a_person_and_somebody_who_sees_stays_one() -> None:
    rng = random.Random(14)
    guesses, seeing = Counter[str](), Counter[str]()
    for seed in range(RUNS):
        person = gamma_person(seed)
        guesses[judge(with_checks(person, rng, 1 / CHOICES)).verdict] += 1
        seeing[judge(with_checks(person, rng, 0.95)).verdict] += 1
    assert guesses["likely"] < RUNS / 100
    assert seeing["likely"] > 0.99 * RUNS
    assert guesses["unlikely"] == 0, "checks alone never make a run unlikely"


def test_the_other_way_caps_the_verdict_at_unclear() -> None:
    checked = with_checks(gamma_person(3), random.Random(1), 1.0)
    assert judge(checked).verdict == "likely"
    declined = [replace(one, other_way=one.part == "check", response=None) for one in checked]
    judged = judge(declined)
    assert judged.verdict == "unclear"
    assert (judged.signals.motion_checks, judged.signals.motion_checks_other_way) == (None, CHECKS)


def void(answers: list[JudgedAnswer], number: int, **changes: Any) -> list[JudgedAnswer]:
    """The first `number` checks of a run with plays that failed."""
    checks = [one.trial_index for one in answers if one.part == "check"][:number]
    return [replace(one, void=True, **changes) if one.trial_index in checks else one for one in answers]


def test_checks_whose_play_failed_are_neither_right_nor_wrong() -> None:
    signals = signals_of(void(with_checks(gamma_person(3), random.Random(1), 0.0), CHECKS))
    assert (signals.motion_checks, signals.motion_checks_guessed) == (None, None)
    assert (signals.motion_checks_asked, signals.motion_checks_void) == (None, CHECKS)


@pytest.mark.parametrize(
    ("number", "changes", "verdict"),
    [
        (CHECKS, {"response": None}, "unclear"),
        (CHECKS, {}, "unclear"),
        (3, {}, "unclear"),
        (2, {}, "likely"),
        (1, {"response": None}, "likely"),
    ],
)
def test_failed_plays_are_not_a_way_around_the_checks(number: int, changes: Any, verdict: str) -> None:
    """Two of ten may fail, as they do on honest people's machines; more leave the run unclear."""
    checked = with_checks(gamma_person(3), random.Random(1), 1.0)
    assert judge(checked).verdict == "likely"
    assert judge(void(checked, number, **changes)).verdict == verdict


def test_an_answer_of_null_to_a_check_that_was_shown_is_wrong() -> None:
    checked = with_checks(gamma_person(3), random.Random(1), 1.0)
    silent = [replace(one, response=None) if one.part == "check" else one for one in checked]
    assert judge(silent).signals.motion_checks == 0
    assert judge(silent).verdict == "unclear"


def test_somebody_who_guesses_gains_nothing_by_failing_the_most_that_may_fail() -> None:
    """Of six digits, the fewest that say anything, one may fail; the five left are still weighed."""
    rng = random.Random(7)
    person = gamma_person(3)
    digits = [replace(one, choices=9) for one in with_checks(person, rng, 1 / 9) if one.part == "check"][:6]
    others = [one for one in person if one.trial_index not in {one.trial_index for one in digits}]
    guesses = [replace(one, response=0) for one in digits]
    judged = judge([*others, *void(guesses, 1)])
    assert judged.signals.motion_checks_guessed == pytest.approx(1)
    assert judged.verdict == "unclear"


def test_a_failed_play_of_the_only_check_says_nothing_of_an_honest_person() -> None:
    """One check of four choices cannot distinguish guesses from people, whether it is answered or not."""
    checked = with_checks(gamma_person(3), random.Random(1), 1.0)
    first = next(one.trial_index for one in checked if one.part == "check")
    alone = [one for one in checked if one.part != "check" or one.trial_index == first]
    assert judge(alone).verdict == "likely"
    assert judge(void(alone, 1)).verdict == "likely"
    assert judge([one for one in alone if one.part != "check"], passed_over=[4]).verdict == "likely"


def test_checks_that_were_passed_over_count_as_void() -> None:
    checked = with_checks(gamma_person(3), random.Random(1), 1.0)
    without = [one for one in checked if one.part != "check"]
    judged = judge(without, passed_over=[4] * CHECKS)
    assert (judged.verdict, judged.signals.motion_checks_void) == ("unclear", CHECKS)
