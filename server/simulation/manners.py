"""Manners of taking part: how people and programs act between two answers, seeded.

Each is a model of who answers; the points of server/evidence/verdict.py were set by them. A second set,
written apart, tests them (tests/server/evidence).
"""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

Interaction = dict[str, Any]


@dataclass(frozen=True)
class Manner:
    """How somebody takes part.

    Attributes
    ----------
    tickets : bool
        Sends the server's tickets.
    fetches : bool
        Fetches clips, and shows it.
    waits : bool
        Lets the clips play.
    rt_ms : callable
        Response time of one answer.
    interaction : callable
        Presses between two answers, None where none are told.
    answers : {"model", "same", "any"}
        By the rater model, always the same, or any.
    reads : bool
        Does what attention checks ask.
    checks : {"sees", "guesses", "goes around"}
        What it makes of motion checks, in which single pictures show nothing.
    offline, reloads, clock_jumps : float
        Chances of each before an answer.
    """

    tickets: bool
    fetches: bool
    waits: bool
    rt_ms: Callable[[random.Random, "Person"], float]
    interaction: Callable[[random.Random, "Person"], Interaction | None]
    answers: Literal["model", "same", "any"] = "model"
    reads: bool = True
    checks: Literal["sees", "guesses", "goes around"] = "guesses"
    offline: float = 0.0
    reloads: float = 0.0
    clock_jumps: float = 0.0


@dataclass(frozen=True)
class Person:
    """What stays the same over one person's visit: pace (median response time, spread) and hand."""

    rt_median_ms: float
    rt_sigma: float
    press_ms: float
    press_sd_ms: float


def person(rng: random.Random) -> Person:
    """Somebody drawn at random."""
    return Person(
        rt_median_ms=rng.lognormvariate(6.7, 0.3),
        rt_sigma=rng.uniform(0.25, 0.6),
        press_ms=rng.uniform(60, 140),
        press_sd_ms=rng.uniform(8, 30),
    )


def _human_rt(rng: random.Random, person: Person) -> float:
    return person.rt_median_ms * rng.lognormvariate(0, person.rt_sigma)


def _slow_rt(rng: random.Random, person: Person) -> float:
    return 3 * _human_rt(rng, person)


def _hasty_rt(rng: random.Random, _person: Person) -> float:
    return rng.lognormvariate(5.3, 0.3)


def _plausible_rt(rng: random.Random, _person: Person) -> float:
    return rng.uniform(500, 1500)


def _polling_rt(rng: random.Random, _person: Person) -> float:
    return 250 + rng.uniform(0, 15)


def _hand(rng: random.Random, person: Person) -> Interaction:
    presses = rng.choice((2, 2, 2, 3))
    length = max(20.0, rng.gauss(person.press_ms, person.press_sd_ms))
    return {"presses": presses, "trusted": presses, "press_ms": round(length, 1), "moves": rng.randrange(60)}


def _synthetic_click(_rng: random.Random, _person: Person) -> Interaction:
    return {"presses": 2, "trusted": 0, "press_ms": None, "moves": 0}


def _driver(rng: random.Random, _person: Person) -> Interaction:
    return {"presses": 2, "trusted": 2, "press_ms": round(rng.uniform(0.3, 1.5), 1), "moves": 2}


def _busy_driver(rng: random.Random, _person: Person) -> Interaction:
    return {"presses": 2, "trusted": 2, "press_ms": round(rng.uniform(5, 60), 1), "moves": 2}


def _screen_reader(_rng: random.Random, _person: Person) -> Interaction:
    return {"presses": 2, "trusted": 2, "press_ms": None, "moves": 0}


def _nothing(_rng: random.Random, _person: Person) -> None:
    return None


MANNERS: dict[str, Manner] = {
    "http": Manner(
        tickets=False, fetches=False, waits=False, rt_ms=_plausible_rt, interaction=_nothing, answers="any"
    ),
    "http-slow": Manner(tickets=True, fetches=True, waits=True, rt_ms=_plausible_rt, interaction=_nothing),
    "script": Manner(
        tickets=True, fetches=True, waits=True, rt_ms=_polling_rt, interaction=_synthetic_click, answers="any"
    ),
    "frames": Manner(tickets=True, fetches=True, waits=True, rt_ms=_human_rt, interaction=_driver),
    "flow": Manner(
        tickets=True, fetches=True, waits=True, rt_ms=_human_rt, interaction=_driver, checks="sees"
    ),
    "careless": Manner(
        checks="sees",
        tickets=True,
        fetches=True,
        waits=True,
        rt_ms=_hasty_rt,
        interaction=_hand,
        answers="same",
        reads=False,
    ),
    "honest": Manner(
        checks="sees",
        tickets=True,
        fetches=True,
        waits=True,
        rt_ms=_human_rt,
        interaction=_hand,
        offline=0.01,
        reloads=0.01,
        clock_jumps=0.01,
    ),
    "assistive": Manner(
        tickets=True,
        fetches=True,
        waits=True,
        rt_ms=_slow_rt,
        interaction=_screen_reader,
        checks="goes around",
    ),
    "scripted": Manner(
        tickets=True,
        fetches=True,
        waits=True,
        rt_ms=_human_rt,
        interaction=_busy_driver,
        answers="any",
        reads=False,
    ),
}
"""http: plain HTTP. http-slow: HTTP with plausible waits and fetched clips. script: a headless browser whose
page a script clicks. frames: a driven browser that answers from single frames. flow: one that computes
optical flow, and so sees what motion checks show. careless: a person, fast and always the same. honest: a
person whose network goes away, who reloads, whose clock jumps. assistive: a screen reader. scripted: a
browser that a script clicks, on a machine whose other work lengthens its presses."""
