"""Verdicts on people and programs other than those that the points were set by."""

import random
from collections import Counter
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from experiments.columns.runs import EVIDENCE_COLUMNS
from server.participation.evidence import (
    BANDS,
    ENOUGH_BY_CHANCE,
    GUESSED_BY_CHANCE,
    SIGNAL_NAMES,
    WITHOUT,
    JudgedAnswer,
    Signals,
    judge,
    signals_of,
    verdict_on,
)

START = datetime(2026, 11, 21, tzinfo=UTC)
HONEST_RUNS, FALSE_ALARMS = 1_000, 0.01
ADVERSE_RUNS = 200
TRIALS, CHECK_EVERY, CLIP_MS = 60, 20, 1_500.0


def answered(rng: random.Random, rt: Any, response: Any, press: Any, **rest: Any) -> list[JudgedAnswer]:
    """The answers of one run: times and responses by the functions given, an attention check now and then."""
    moment, answers = START, []
    for index in range(TRIALS):
        check = index % CHECK_EVERY == CHECK_EVERY - 1
        took = rt(index)
        moment += timedelta(milliseconds=CLIP_MS * (not check) + took + 600)
        presses, trusted, length = press(index)
        values = {
            "trial_index": index,
            "play": 1,
            "part": "attention" if check else "main",
            "expected": 2 if check else None,
            "choices": 7 if check else 0,
            "response": 2 if check and rest.get("reads", True) else response(index),
            "rt": took,
            "clip_ms": 0.0 if check else CLIP_MS,
            "needs_digest": not check,
            "issued_at": START if rest.get("tickets", True) else None,
            "digest_right": None if check or not rest.get("digests", True) else True,
            "received_at": moment,
            "presses": presses,
            "trusted": trusted,
            "press_ms": length,
        }
        answers.append(JudgedAnswer(**values))
    return answers


def gamma_person(seed: int) -> list[JudgedAnswer]:
    """An honest run by another model than the simulation's: ex-Gaussian times, autocorrelated answers.

    Its network goes away for some answers, which then come together, its clock jumps (which no signal reads),
    and it reloads, whereupon later tickets are younger.
    """
    rng = random.Random(f"gamma {seed}")
    base, tail = rng.uniform(350, 900), rng.uniform(150, 900)
    press = rng.gammavariate(9, rng.uniform(7, 14))
    level = [rng.uniform(2, 6)]

    def response(_index: int) -> int:
        level[0] = 0.4 * level[0] + 0.6 * rng.uniform(1, 7)
        return max(1, min(7, round(level[0])))

    def presses(_index: int) -> tuple[int, int, float | None]:
        # Somebody who holds a finger on touch glass now and then, or presses twice.
        count = rng.choice((1, 2, 2, 3))
        return count, count, None if rng.random() < 0.05 else max(15.0, rng.gauss(press, press / 5))

    answers = answered(
        rng, lambda _: max(180.0, rng.gauss(base, base / 8)) + rng.expovariate(1 / tail), response, presses
    )
    return with_mishaps(rng, answers)


def with_mishaps(rng: random.Random, answers: list[JudgedAnswer]) -> list[JudgedAnswer]:
    away_from = rng.randrange(TRIALS)
    away_to = min(TRIALS - 1, away_from + rng.randrange(0, 20))
    back = answers[away_to].received_at + timedelta(minutes=rng.uniform(0, 60))
    reload_at = rng.randrange(TRIALS)
    changed = []
    for index, one in enumerate(answers):
        values = {field.name: getattr(one, field.name) for field in fields(one)}
        if away_from <= index <= away_to:
            values |= {"received_at": back, "late": True}
        elif index > away_to:
            values["received_at"] = back + (one.received_at - answers[away_to].received_at)
        if index >= reload_at:
            values["issued_at"] = answers[max(0, reload_at - 1)].received_at
        changed.append(JudgedAnswer(**values))
    return changed


def polling_script(seed: int) -> list[JudgedAnswer]:
    """A headless browser polling each 250 ms, as the page's own `act` does."""
    rng = random.Random(seed)
    return answered(
        rng, lambda _: 250 * rng.choice((1, 1, 2)), lambda _: 4, lambda _: (2, 0, None), reads=False
    )


def patient_script(seed: int) -> list[JudgedAnswer]:
    """A script that waits a random time, reads the checks, and calls click()."""
    rng = random.Random(seed)
    return answered(
        rng, lambda _: rng.uniform(400, 3000), lambda _: rng.randint(1, 7), lambda _: (2, 0, None)
    )


def driver(seed: int) -> list[JudgedAnswer]:
    """A browser driven over its debugging protocol: trusted input without a hand's time."""
    rng = random.Random(seed)
    return answered(
        rng,
        lambda _: rng.lognormvariate(6.6, 0.4),
        lambda _: rng.randint(1, 7),
        lambda _: (2, 2, rng.uniform(0, 3)),
    )


def driver_with_delay(seed: int) -> list[JudgedAnswer]:
    """The same with the delay option that drivers offer: each press lasts 80 ms, give or take the timer."""
    rng = random.Random(seed)
    return answered(
        rng,
        lambda _: rng.lognormvariate(6.6, 0.4),
        lambda _: rng.randint(1, 7),
        lambda _: (2, 2, 80 + rng.uniform(0, 1.5)),
    )


def http_with_tickets(seed: int) -> list[JudgedAnswer]:
    """Plain HTTP that sends tickets and digests, waits, and knows nothing of presses."""
    rng = random.Random(seed)
    return answered(
        rng, lambda _: rng.gauss(900, 200), lambda _: rng.randint(1, 7), lambda _: (None, None, None)
    )


def http_without_clips(seed: int) -> list[JudgedAnswer]:
    """Plain HTTP against a server that only records: no ticket, no digest."""
    rng = random.Random(seed)
    nothing = lambda _: (None, None, None)  # noqa: E731 - three of one kind
    return answered(rng, lambda _: 700.0, lambda _: rng.randint(1, 7), nothing, tickets=False, digests=False)


def driver_on_a_busy_machine(seed: int) -> list[JudgedAnswer]:
    """A browser clicked by a script, whose presses the machine's other work makes 8 to 70 ms long."""
    rng = random.Random(seed)
    longest = rng.uniform(18, 70)
    return answered(
        rng,
        lambda _: rng.lognormvariate(6.6, 0.4),
        lambda _: rng.randint(1, 7),
        lambda _: (2, 2, rng.uniform(8, longest)),
        reads=False,
    )


ADVERSARIES = (
    driver_on_a_busy_machine,
    polling_script,
    patient_script,
    driver,
    driver_with_delay,
    http_with_tickets,
    http_without_clips,
)


@pytest.mark.parametrize("adversary", ADVERSARIES, ids=lambda one: one.__name__)
def test_no_program_is_likely_a_person(adversary: Any) -> None:
    verdicts = Counter(judge(adversary(seed)).verdict for seed in range(ADVERSE_RUNS))
    assert verdicts["likely"] == 0


BEST = {
    "tickets": 1.0,
    "digests": 1.0,
    "clip_time": 0.8,
    "claimed_time": 0.9,
    "order": 1.0,
    "late": 0.0,
    "interaction": 1.0,
    "trusted": 1.0,
    "press_ms": 90.0,
    "press_spread": 20.0,
    "rt_median": 900.0,
    "rt_spread": 0.4,
    "same_answer": 0.3,
    "cycle": 0.2,
}
"""What an honest person's signals are, without those of checks."""
ANY = {name: st.one_of(st.none(), st.floats(0, 2_000), st.floats(0, 1.2)) for name in BEST}
NO_CHECK = st.fixed_dictionaries(
    {
        "motion_checks_void": st.one_of(st.none(), st.integers(0, 10)),
        "motion_checks_other_way": st.one_of(st.none(), st.integers(0, 10)),
    }
)
FAILED = st.fixed_dictionaries(
    {
        "checks": st.one_of(st.none(), st.floats(0, 1)),
        "motion_checks": st.one_of(st.none(), st.floats(0, 1)),
        "motion_checks_guessed": st.one_of(st.none(), st.floats(GUESSED_BY_CHANCE, 1)),
        "checks_guessed": st.floats(ENOUGH_BY_CHANCE, 1),
    }
)


@given(signals=st.fixed_dictionaries(ANY), checks=st.one_of(NO_CHECK, FAILED))
@example(signals=BEST, checks={})
@example(signals=BEST | {"press_ms": 15.0}, checks={})
@example(signals=BEST, checks={"checks": 1.0, "checks_guessed": 1 / 7})
@settings(max_examples=500, deadline=None)
def test_no_combination_of_signals_is_likely_without_a_passed_check(
    signals: dict[str, float | None], checks: dict[str, float | None]
) -> None:
    verdict, _ = verdict_on(Signals(**signals, **checks), answers=60, refused=False, tells=True)
    assert verdict != "likely"


@given(signals=st.fixed_dictionaries(ANY), press=st.floats(0, 2_000), spread=st.floats(0, 500))
@settings(max_examples=500, deadline=None)
def test_lengths_of_presses_only_ever_speak_against_a_run(
    signals: dict[str, float | None], press: float, spread: float
) -> None:
    """With passed checks too, presses of any length carry no run further than presses of 90 ms do."""
    passed = {"checks": 1.0, "motion_checks_guessed": 1e-6, "checks_guessed": 1e-6}
    measured = Signals(**(signals | passed | {"press_ms": press, "press_spread": spread}))
    without = Signals(**(signals | passed | {"press_ms": 90.0, "press_spread": None}))
    points = [verdict_on(one, answers=60, refused=False, tells=False)[1] for one in (measured, without)]
    assert points[0] <= points[1]


def test_the_best_signals_with_passed_checks_are_a_persons() -> None:
    """The property above is not met by never saying `likely`."""
    passed = {"checks": 1.0, "checks_guessed": 7**-3}
    assert verdict_on(Signals(**BEST, **passed), answers=60, refused=False, tells=False)[0] == "likely"


@pytest.mark.parametrize(
    ("choices", "right", "verdict"),
    [
        ([7, 9, 9], 3, "likely"),
        ([7, 9, 9], 2, "likely"),
        ([9, 9, 7], 2, "unclear"),
        ([7, 9, 9], 1, "unclear"),
        ([7, 7], 2, "likely"),
        ([7, 7], 1, "unclear"),
        ([7], 1, "unclear"),
        ([2, 2], 2, "unclear"),
        ([], 0, "unclear"),
    ],
)
def test_checks_are_passed_where_guessing_hardly_does_as_well(
    choices: list[int], right: int, verdict: str
) -> None:
    """Attention questions (7 or 2 answers) and motion checks (9) count together; the first `right` are right.

    A question of attention that is wrong takes points besides.
    """
    person = [replace(one, part="main", expected=None) for one in gamma_person(4)]
    for number, options in enumerate(choices):
        part = "check" if options == 9 else "attention"
        given = 1 if number < right else 2
        person[10 + number] = replace(
            person[10 + number], part=part, choices=options, expected=1, response=given
        )
    assert judge(person).verdict == verdict


def test_honest_people_are_hardly_ever_doubted() -> None:
    verdicts = Counter(judge(gamma_person(seed)).verdict for seed in range(HONEST_RUNS))
    assert verdicts["likely"] > HONEST_RUNS * (1 - FALSE_ALARMS)
    assert verdicts["unlikely"] == 0


def test_assistive_technology_is_never_unlikely() -> None:
    """A switch or speech that activates buttons: no press has a length, and scripts may have made them."""

    def switch(seed: int) -> list[JudgedAnswer]:
        rng = random.Random(seed)
        trusted = rng.choice((0, 2))
        return answered(
            rng,
            lambda _: rng.lognormvariate(8, 0.5),
            lambda _: rng.randint(1, 7),
            lambda _: (2, trusted, None),
        )

    verdicts = Counter(judge(switch(seed)).verdict for seed in range(ADVERSE_RUNS))
    assert verdicts["unlikely"] == 0


def test_few_answers_are_not_enough() -> None:
    assert judge(gamma_person(1)[:5]).verdict == "unclear"
    assert signals_of([]) == Signals()


def test_the_export_has_a_column_a_signal() -> None:
    assert tuple(column.name for column in EVIDENCE_COLUMNS) == tuple(
        f"evidence_{name}" for name in SIGNAL_NAMES
    )
    assert {*BANDS, *WITHOUT} <= set(SIGNAL_NAMES)


def test_a_run_of_refused_answers_is_unlikely_and_one_without_answers_is_not_judged() -> None:
    assert judge([], refused=True).verdict == "unlikely"
    assert judge([]).verdict == "not_judged"


def test_response_times_that_there_was_no_time_for_speak_against_a_run() -> None:
    """A program that waits as long as the clips last, and claims the response times of a person."""
    person = gamma_person(1)
    assert judge(person).verdict == "likely"
    hurried = [
        replace(one, received_at=START + (index + 1) * timedelta(milliseconds=CLIP_MS + 50), issued_at=START)
        for index, one in enumerate(person)
    ]
    signals = judge(hurried).signals
    assert signals.clip_time is not None
    assert signals.clip_time < 1
    assert signals.claimed_time is not None
    assert signals.claimed_time > 1.05
    assert judge(hurried).verdict != "likely"
