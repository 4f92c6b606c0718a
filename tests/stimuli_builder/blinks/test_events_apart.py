"""Events of one eye that overlap, made by hand: which stays, and where they part."""

from dataclasses import replace

import numpy as np
import pytest

from stimuli_builder.blinks.events.recognise import _listed, _PieceEvents
from stimuli_builder.blinks.events.rules import LidEvent, separate_events

FPS = 100.0


def event(kind, onset_s, end_s, *, minimum_s=None, closed=None):
    """An event whose closed phase is its middle third, or the times given."""
    minimum_s = (onset_s + end_s) / 2 if minimum_s is None else minimum_s
    third = (end_s - onset_s) / 3
    first, last = (onset_s + third, end_s - third) if closed is None else closed
    return LidEvent(kind, 0.9, round(minimum_s * FPS), onset_s, first, minimum_s, last, end_s, 0.9)


def depth_open_at(*times_s):
    """Depth of ten seconds, 1 but for moments at which the eye is open."""
    depth = np.ones(1000)
    for time_s in times_s:
        depth[round(time_s * FPS)] = 0.0
    return depth


def times(events):
    return [(one.kind, round(one.onset_s, 3), round(one.end_s, 3)) for one in events]


def test_two_blinks_part_where_the_eye_is_open_widest():
    events = [event("blink", 1.0, 1.6, minimum_s=1.2), event("blink", 1.4, 2.0, minimum_s=1.8)]
    assert times(separate_events(events, depth_open_at(1.45), 0, FPS)) == [
        ("blink", 1.0, 1.45),
        ("blink", 1.45, 2.0),
    ]


def test_a_piece_that_begins_later_parts_at_the_same_time():
    events = [event("blink", 1.0, 1.6, minimum_s=1.2), event("blink", 1.4, 2.0, minimum_s=1.8)]
    depth = depth_open_at(1.45)[80:]
    assert times(separate_events(events, depth, 80, FPS)) == [("blink", 1.0, 1.45), ("blink", 1.45, 2.0)]


def test_nested_blinks_are_both_kept_and_part():
    events = [event("blink", 1.0, 2.0, minimum_s=1.3), event("blink", 1.5, 1.8, minimum_s=1.65)]
    assert times(separate_events(events, depth_open_at(1.5), 0, FPS)) == [
        ("blink", 1.0, 1.5),
        ("blink", 1.5, 1.8),
    ]


@pytest.mark.parametrize("kind", ["closed_eye", "squint", "gaze_shift"])
def test_one_motion_reported_twice_is_the_longer_event(kind):
    events = [event(kind, 1.0, 4.0), event(kind, 2.0, 3.2)]
    assert times(separate_events(events, depth_open_at(), 0, FPS)) == [(kind, 1.0, 4.0)]


def test_a_squint_within_a_gaze_shift_is_the_gaze_shift():
    events = [event("squint", 2.0, 2.5), event("gaze_shift", 1.0, 3.0)]
    assert times(separate_events(events, depth_open_at(), 0, FPS)) == [("gaze_shift", 1.0, 3.0)]


@pytest.mark.parametrize("lowered", ["squint", "gaze_shift"])
def test_a_blink_of_a_lowered_lid_stays_as_it_is(lowered):
    events = [event(lowered, 1.0, 3.0), event("blink", 1.5, 1.8)]
    assert times(separate_events(events, depth_open_at(), 0, FPS)) == [
        ("blink", 1.5, 1.8),
        (lowered, 1.0, 3.0),
    ]


def test_a_closed_eye_that_is_cut_but_stays_shut_for_half_a_second_stays_one():
    events = [
        event("closed_eye", 1.0, 3.0, closed=(1.2, 2.8)),
        event("blink", 2.5, 3.4, minimum_s=3.1),
    ]
    parted = separate_events(events, depth_open_at(2.6), 0, FPS)
    assert times(parted) == [("closed_eye", 1.0, 2.6), ("blink", 2.6, 3.4)]
    assert parted[0].closed_to_s == 2.6


def test_a_closed_eye_of_whose_closed_phase_little_is_left_is_none_and_cuts_nobody():
    """It lasts for 0.7 s from onset to end, but is shut for 0.2 s of them."""
    events = [
        event("closed_eye", 1.0, 2.4, minimum_s=1.6, closed=(1.5, 2.2)),
        event("blink", 1.65, 2.6, minimum_s=2.3),
    ]
    assert times(separate_events(events, depth_open_at(1.7), 0, FPS)) == [("blink", 1.65, 2.6)]


def test_events_that_only_touch_stay_as_they_are():
    events = [event("blink", 1.0, 1.5), event("blink", 1.5, 2.0)]
    assert separate_events(events, depth_open_at(), 0, FPS) == events


def listed(*events, squints=()):
    told = _PieceEvents(list(events), {one.frame: replace(one, kind="squint") for one in squints}, [])
    return [one.kind for one in _listed(told)]


def test_a_blink_that_a_squint_explains_is_listed_as_that():
    doubtful = event("blink", 2.9, 3.1)
    assert listed(event("blink", 0.9, 1.1), doubtful, squints=(doubtful,)) == ["blink", "squint"]


def test_a_ripple_of_a_closed_eye_is_not_a_squint():
    ripple = event("blink", 2.9, 3.1)
    assert "squint" not in listed(event("closed_eye", 2.3, 3.9), ripple, squints=(ripple,))


def test_of_two_blinks_too_close_the_one_that_is_not_a_squint_stays():
    doubtful, sure = replace(event("blink", 2.9, 3.1), probability=0.95), event("blink", 3.0, 3.2)
    assert listed(doubtful, sure, squints=(doubtful,)) == ["blink"]
