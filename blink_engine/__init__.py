"""Living eyelids: a seeded stream of lid curves for animation, avatars and robots.

Pure numpy; the same core in TypeScript gives the same curves (docs/blink-engine.md).
"""

from blink_engine.engine import BlinkEngine, LidFrame
from blink_engine.events import EVENT_KINDS, Event, EventKind, Response
from blink_engine.laws import Law
from blink_engine.parameters import (
    STATE_NAMES,
    Drift,
    Parameters,
    ProfileModel,
    StateName,
    default_parameters,
)
from blink_engine.performance import Performance, StateChange, perform
from blink_engine.plan import Blink
from blink_engine.profile import BlinkShape

__all__ = [
    "EVENT_KINDS",
    "STATE_NAMES",
    "Blink",
    "BlinkEngine",
    "BlinkShape",
    "Drift",
    "Event",
    "EventKind",
    "Law",
    "LidFrame",
    "Parameters",
    "Performance",
    "ProfileModel",
    "Response",
    "StateChange",
    "StateName",
    "default_parameters",
    "perform",
]
