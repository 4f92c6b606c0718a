"""Clips rated while they are shown: a slider's place, sampled at their frames."""

from experiments.assignment.shares import lines as planned
from experiments.schema.effects import Effect
from experiments.trials.clip_rating.plan import block_size
from experiments.trials.continuous_rating.answer import ContinuousAnswer, check_response
from experiments.trials.continuous_rating.columns import TRACES
from experiments.trials.continuous_rating.declaration import CHECK_POINTS, ContinuousRating
from experiments.trials.continuous_rating.page import ShownContinuousRating, shown
from experiments.trials.continuous_rating.plan import assign
from experiments.trials.kind import Kind

EFFECTS: dict[str, Effect] = {
    "kind": "measured",
    "question": "measured",
    "low": "measured",
    "high": "measured",
    "minimum": "measured",
    "maximum": "measured",
    "input": "measured",
    "seconds_across": "measured",
    "sample_hz": "measured",
    "max_lag_s": "wording",
    "pointer_delay_ms": "wording",
    "expected_seconds": "wording",
}

EXAMPLE = """\
[trial]
kind = "continuous_rating"
question = { en = "How alive do these eyes look, moment by moment?" }
low = { en = "not at all alive" }
high = { en = "very much alive" }
minimum = 0.0
maximum = 100.0
input = "keys"
seconds_across = 3.0
sample_hz = 10
max_lag_s = 3.0
pointer_delay_ms = 1500
expected_seconds = 25.0
"""

CONTINUOUS_RATING = Kind(
    declaration=ContinuousRating,
    answer=ContinuousAnswer,
    view=TRACES,
    roles=("shown",),
    effects=EFFECTS,
    page=ShownContinuousRating,
    shown=shown,
    assign=assign,
    block_size=block_size,
    plan=planned,
    shares_clips=True,
    example=EXAMPLE,
    check_response=check_response,
    check_choices=lambda _: CHECK_POINTS,
)
