"""Clips rated while they play: assignment, page model, columns."""

import random
from typing import Literal

from experiments.assignment import Trial
from experiments.assignment.order import single_clips
from experiments.assignment.shares import lines as planned
from experiments.columns import base
from experiments.columns.base import rows_of
from experiments.columns.column import Column
from experiments.columns.playback import answer_columns
from experiments.columns.view import View
from experiments.declaration.base import Declaration, Translated
from experiments.declaration.clip_rating import Points
from experiments.declaration.continuous_rating import (
    CHECK_POINTS,
    ContinuousAnswer,
    ContinuousRating,
    check_response,
    continuous_rating_of,
)
from experiments.declaration.experiment import Experiment
from experiments.kinds.clip_rating import block_size
from experiments.kinds.kind import Kind
from experiments.schema.effects import Effect

# Exports of a continuous rating: the base columns and the trace, one row per presentation.
# Alias in addition to those of the base columns: k clips.

ANSWER: tuple[Column, ...] = (
    Column(
        "response",
        "number",
        "Mean of the trace, or the answer to an attention check.",
        source="t.payload",
        member="response",
    ),
    Column(
        "expected_response",
        "integer",
        "The required answer in an attention check (1 to 7), or the correct answer in a motion check.",
        source="a",
    ),
    Column(
        "trace",
        "text",
        "JSON list of the rating at each sampled frame; sample k (from 0) is taken at frame k * step_frames.",
        source="t.payload",
        member="values",
    ),
    Column(
        "step_frames",
        "integer",
        "Number of frames from one sample to the next.",
        unit="frame",
        minimum=1,
        source="t.payload",
        member="step_frames",
    ),
    Column("clip_fps", "number", "Frame rate of the clip.", unit="Hz", source="k.fps"),
    Column(
        "moves",
        "integer",
        "How often the slider began to move.",
        minimum=0,
        source="t.payload",
        member="moves",
    ),
    Column(
        "blinks_s",
        "text",
        "JSON list of the onsets of the blinks in a performance, in seconds from the first frame; empty "
        "for other clips.",
        source="c",
        json=True,
    ),
)

TRACES = View(
    name="traces",
    title="Traces: one row per presentation of a clip",
    columns=answer_columns(base.CLIP, ANSWER),
    rows=rows_of("continuous_rating", {"shown": "c"}, "LEFT JOIN clips k ON k.sha256 = c.clip_sha256\n"),
)


# What the participant's page receives about a continuous rating.


class ShownContinuousRating(Declaration):
    """The declared continuous rating as the page receives it."""

    kind: Literal["continuous_rating"]
    question: Translated
    low: Translated
    high: Translated
    minimum: float
    maximum: float
    input: Literal["slider", "keys"]
    seconds_across: float
    sample_hz: int
    pointer_delay_ms: int
    check_scale: Points
    expected_seconds: float


def shown(experiment: Experiment) -> ShownContinuousRating:
    """Return the part of the declared trial that its page needs."""
    trial = continuous_rating_of(experiment)
    check = Points(question=trial.question, low=trial.low, high=trial.high, minimum=1, maximum=CHECK_POINTS)
    return ShownContinuousRating(
        kind=trial.kind,
        question=trial.question,
        low=trial.low,
        high=trial.high,
        minimum=trial.minimum,
        maximum=trial.maximum,
        input=trial.input,
        seconds_across=trial.seconds_across,
        sample_hz=trial.sample_hz,
        pointer_delay_ms=trial.pointer_delay_ms,
        check_scale=check,
        expected_seconds=trial.expected_seconds,
    )


# Who rates which clips in what order: as for single clips.


def assign(experiment: Experiment, seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`."""

    def asked(rng: random.Random) -> int:
        return rng.randint(1, CHECK_POINTS)

    return single_clips(experiment, seed, slot, asked)


# Clips rated while they play: the position of a slider, sampled at their frames.

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
