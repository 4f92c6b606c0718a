"""Write tests/golden/blink_engine/vectors.json: what the engine gives, for its twin in TypeScript to equal.

PYTHONPATH=. python tools/blink_vectors.py
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from blink_engine import (
    STATE_NAMES,
    BlinkEngine,
    Event,
    Law,
    Parameters,
    StateChange,
    default_parameters,
    perform,
)
from blink_engine.laws import RandomNumbers

VECTORS = Path(__file__).resolve().parent.parent / "tests/golden/blink_engine/vectors.json"
EVENTS = (
    Event("pause", 2.2),
    Event("gaze_shift", 5.0, 40.0),
    Event("turn_end", 5.3),
    Event("blink", 9.1),
    Event("head_turn", 12.0, 20.0),
    Event("utterance_start", 14.02),
    Event("utterance_end", 17.5),
)
CHANGES = (StateChange("speaking", 4.0), StateChange("reading", 21.0), StateChange("listening", 33.0))


def lively() -> Parameters:
    """Return parameters under which every kind of blink comes, with gamma intervals in one state."""
    parameters = default_parameters().with_profile(long_share=0.2, double_share=0.2)
    gamma = {**parameters.intervals, "rest": Law("gamma", 2.5, 0.8)}
    return Parameters(**{**vars(parameters), "intervals": gamma})


def numbers() -> list[dict[str, Any]]:
    """First numbers of some streams."""
    rows = []
    for seed, stream in ((0, 1), (1, 2), (2011, 3), (-5, 0), (2**40 + 7, 1)):
        stream_numbers = RandomNumbers(seed, stream)
        rows.append(
            {
                "seed": seed,
                "stream": stream,
                "integers": [stream_numbers.integer() for _ in range(6)],
                "uniforms": [stream_numbers.uniform() for _ in range(4)],
                "normals": [stream_numbers.normal() for _ in range(4)],
            }
        )
    return rows


def performances() -> list[dict[str, Any]]:
    """Lid curves of several seeds, states and parameters, with and without events."""
    rows = []
    for seed, state in enumerate(STATE_NAMES):
        for parameters, name in ((default_parameters(), "default"), (lively(), "lively")):
            done = perform(
                40.0, 12.5, seed=seed, state=state, events=EVENTS, changes=CHANGES, parameters=parameters
            )
            rows.append(
                {
                    "seed": seed,
                    "state": state,
                    "parameters": name,
                    "left": [round(value, 9) for value in done.left.tolist()],
                    "right": [round(value, 9) for value in done.right.tolist()],
                    "causes": [blink.cause for blink in done.blinks],
                }
            )
    return rows


def frames() -> dict[str, Any]:
    """Single frames with gaze and squint."""
    engine = BlinkEngine(seed=7)
    given = [(k / 10, 5.0 * (k % 9) - 10.0, (k % 4) / 4) for k in range(60)]
    return {"seed": 7, "given": given, "frames": [list(asdict(engine.frame(*one)).values()) for one in given]}


def held_frames() -> dict[str, Any]:
    """A stream whose flag goes up and down every 7 s."""
    engine, left = BlinkEngine(seed=5, state="speaking"), []
    for k in range(400):
        if k % 70 == 0:
            engine.hold_blinks(k % 140 == 70, k / 10)
        left.append(round(engine.frame(k / 10).left, 9))
    return {"seed": 5, "state": "speaking", "left": left}


def vectors() -> dict[str, Any]:
    """Return what the file holds."""
    return {
        "events": [asdict(event) for event in EVENTS],
        "changes": [asdict(change) for change in CHANGES],
        "numbers": numbers(),
        "performances": performances(),
        "frames": frames(),
        "held": held_frames(),
    }


if __name__ == "__main__":
    VECTORS.parent.mkdir(parents=True, exist_ok=True)
    VECTORS.write_text(json.dumps(vectors()) + "\n", encoding="utf-8")
