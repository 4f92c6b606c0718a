"""Measure the blink template from the profiles that ship and write it.

python -m stimuli_builder.blinks.events.measure_template
"""

import json
import sys

import numpy as np

from experiments.files import whole_text
from stimuli_builder.blinks.events.template import FORMS
from stimuli_builder.blinks.library import load_library
from stimuli_builder.blinks.profile import Array, BlinkProfile

NODES = 41
TOP = 0.97
"""Part of the greatest closure from which a profile counts as turning: above it is the closed phase."""
SHORTEST_HOLD_S = 0.004
SPREAD = (0.35, 1.2, 0.45)
"""Spread of the logarithms of the phases, wider than one person's (VanderWerf et al. 2003, over people)."""


def phases(profile: BlinkProfile) -> tuple[Array, Array, tuple[float, float, float]]:
    """Closing and opening of one profile over even shares of the phase, and the three phases in seconds."""
    closure = profile.closure / profile.closure.max()
    top = np.flatnonzero(closure >= TOP)
    first, last = int(top[0]), int(top[-1])
    shares = np.linspace(0, 1, NODES)
    before, after = closure[profile.onset_index : first + 1], closure[last : profile.end_index + 1]
    closing = np.interp(shares * (before.size - 1), np.arange(before.size), before)
    opening = np.interp(shares * (after.size - 1), np.arange(after.size), after)
    seconds = (
        before.size / profile.fps,
        max((last - first) / profile.fps, SHORTEST_HOLD_S),
        after.size / profile.fps,
    )
    return closing, 1 - opening, seconds


def make_rising(mean: Array) -> Array:
    """Make a mean form rise strictly from 0 to 1."""
    form = np.maximum.accumulate((mean - mean[0]) / (mean[-1] - mean[0])) + np.linspace(0, 1e-6, mean.size)
    return np.asarray(form / form[-1])


def main() -> None:
    """Measure and write."""
    deep = [
        profile for profile in load_library() if profile.closure_other is None and profile.amplitude > 0.5
    ]
    closings, openings, seconds = zip(*(phases(profile) for profile in deep), strict=True)
    document = {
        "made_by": "python -m stimuli_builder.blinks.events.measure_template",
        "profiles": [profile.profile_id for profile in deep],
        "closing": np.round(make_rising(np.mean(closings, axis=0)), 6).tolist(),
        "opening": np.round(make_rising(np.mean(openings, axis=0)), 6).tolist(),
        "log_s": np.round(np.median(np.log(seconds), axis=0), 4).tolist(),
        "log_sd": list(SPREAD),
    }
    with whole_text(FORMS) as stream:
        json.dump(document, stream)
        stream.write("\n")
    sys.stdout.write(f"{FORMS}: {len(deep)} profiles\n")


if __name__ == "__main__":
    main()
