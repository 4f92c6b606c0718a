"""Living eyelids: a seeded stream of lid curves for animation, avatars and robots.

Pure numpy; the same core in TypeScript gives the same curves (docs/explanation/blink-engine.md).
"""

from blink_engine.laws import Law
from blink_engine.parameters import (
    EVENT_KINDS,
    STATE_NAMES,
    Drift,
    Event,
    EventKind,
    Parameters,
    ProfileModel,
    Response,
    StateName,
    default_parameters,
)
from blink_engine.performance import BlinkEngine, Hold, LidFrame, Performance, StateChange, perform
from blink_engine.plan import Blink, BlinkShape

__all__ = [
    "EVENT_KINDS",
    "STATE_NAMES",
    "Blink",
    "BlinkEngine",
    "BlinkShape",
    "Drift",
    "Event",
    "EventKind",
    "Hold",
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
