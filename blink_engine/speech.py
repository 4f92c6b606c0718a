"""Speech as stretches of time, and the events that the blink engine gets from them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from zlib import crc32

from blink_engine.parameters import Event, StateName
from blink_engine.performance import StateChange

PAUSE_MIN_S = 0.18
"""Shorter gaps are closures of stops, not pauses (Heldner & Edlund 2010, Journal of Phonetics 38, 555)."""
UTTERANCE_GAP_S = 0.6
"""A longer gap ends an utterance."""
TURN_GAP_S = 1.5
"""A longer gap ends the turn: the other one speaks, or nobody."""


def seed_of_speaker(seed: int, speaker: str) -> int:
    """The seed of one of several people: two of one dialogue and one seed must not blink alike.

    The first 32 bits that count for the engine are those of `seed` and of the CRC-32 of the name (UTF-8),
    combined by exclusive or.

    >>> seed_of_speaker(1, "Anna") == seed_of_speaker(1, "Ben")
    False
    """
    return seed ^ crc32(speaker.encode("utf-8", "surrogatepass"))


@dataclass(frozen=True)
class Speech:
    """One stretch of uninterrupted speech, from `start_s` to `end_s`."""

    start_s: float
    end_s: float


def join_speech(stretches: Iterable[Speech], gap_s: float = PAUSE_MIN_S) -> list[Speech]:
    """Return the stretches in order; those that overlap or are less than `gap_s` apart are merged."""
    whole: list[Speech] = []
    for one in sorted(stretches, key=lambda stretch: (stretch.start_s, stretch.end_s)):
        if whole and one.start_s - whole[-1].end_s < gap_s:
            whole[-1] = Speech(whole[-1].start_s, max(whole[-1].end_s, one.end_s))
        else:
            whole.append(one)
    return whole


def speech_events(stretches: Sequence[Speech]) -> list[Event]:
    """Return utterance starts and ends, pauses and turn ends of stretches that are joined and in order."""
    if not stretches:
        return []
    events = [Event("utterance_start", stretches[0].start_s)]
    for one, following in pairwise(stretches):
        gap = following.start_s - one.end_s
        if gap < UTTERANCE_GAP_S:
            events.append(Event("pause", one.end_s))
        else:
            events.append(Event("turn_end" if gap >= TURN_GAP_S else "utterance_end", one.end_s))
            events.append(Event("utterance_start", following.start_s))
    return [*events, Event("turn_end", stretches[-1].end_s)]


def speech_states(stretches: Sequence[Speech], between: StateName = "listening") -> list[StateChange]:
    """Return when the person speaks, and is in the state `between` in longer gaps."""
    changes = [StateChange(between, 0.0)]
    for one in join_speech(stretches, TURN_GAP_S):
        changes += [StateChange("speaking", one.start_s), StateChange(between, one.end_s)]
    return changes
