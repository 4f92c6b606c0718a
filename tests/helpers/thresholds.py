"""The stored answers of adaptive series as rows of their view, and a study that has some."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import text
from sqlalchemy.orm import Session

FACTORS = """
[[factors]]
name = "duration"
label = "Duration"
levels = [
    { name = "100", label = "100 ms", render = { duration_frames = 3.0 } },
    { name = "200", label = "200 ms", render = { duration_frames = 6.0 } },
    { name = "300", label = "300 ms", render = { duration_frames = 9.0 } },
    { name = "400", label = "400 ms", render = { duration_frames = 12.0 } },
    { name = "500", label = "500 ms", render = { duration_frames = 15.0 } },
]

[[factors]]
name = "character"
label = "Character"
levels = [
    { name = "photorealistic", label = "A", render = { character = "alder@8" } },
    { name = "cartoon", label = "B", render = { character = "cartoon" } },
]
"""
YES_NO = """
[trial]
kind = "threshold"
question = { en = "Slow?", de = "Langsam?" }
stimulus = { factor = "duration" }
stop = { trials = 8 }
ahead = 2

[trial.task]
asks = "yes_no"
yes = { en = "Yes", de = "Ja" }
no = { en = "No", de = "Nein" }
"""
TWO_INTERVAL = """
[trial]
kind = "threshold"
question = { en = "Which was slower?", de = "Welcher war langsamer?" }
stimulus = { factor = "duration" }
stop = { trials = 6 }

[trial.task]
asks = "two_interval"
standard = "100"
first = { en = "The first", de = "Der erste" }
second = { en = "The second", de = "Der zweite" }
gap_ms = 100
"""


def thresholds(session: Session) -> Sequence[Mapping[str, Any]]:
    """Every row of the view, by run, trial and play."""
    query = text("SELECT * FROM thresholds ORDER BY run, trial_index, play")
    return [dict(row) for row in session.execute(query).mappings()]


def text_with(short: str, trial: str = YES_NO, factors: str = FACTORS) -> str:
    """The short study of the tests with these factors and this trial."""
    head = short[: short.index("[[factors]]")]
    between = short[short.index("[exemplars]") : short.index("[trial]")]
    between = between.replace('split_by = "character"\norder = "alternating"', "repeats = 1")
    return head + factors + between + trial + short[short.index("[[exclusions]]") :]
