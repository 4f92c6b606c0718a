"""A forced choice of two words after a clip: who sees what, page, columns."""

import random
from typing import Literal

from experiments.declaration.word_choice import WordAnswer, WordChoice, word_choice_of

from experiments.assignment import Trial
from experiments.assignment.order import single_clips
from experiments.columns import base
from experiments.columns.base import rows_of
from experiments.columns.column import Column
from experiments.columns.playback import answer_columns
from experiments.columns.view import View
from experiments.declaration.base import Declaration, Translated
from experiments.declaration.experiment import Experiment
from experiments.kinds.clip_rating import block_size
from experiments.kinds.kind import Kind

WORDS = ("first", "second")
ANSWER = (
    Column("word", "text", "The word chosen.", values=WORDS, source="t.payload", member="chosen"),
    Column("expected_response", "integer", "The word asked for in an attention check (1, 2).", source="a"),
)


class ShownWordChoice(Declaration):
    """The declared choice as the page gets it."""

    kind: Literal["word_choice"]
    question: Translated
    first: Translated
    second: Translated
    pointer_delay_ms: int
    expected_seconds: float


def shown(experiment: Experiment) -> ShownWordChoice:
    """Return the part of the declared trial that its page needs."""
    trial = word_choice_of(experiment)
    return ShownWordChoice(
        kind=trial.kind,
        question=trial.question,
        first=trial.first,
        second=trial.second,
        pointer_delay_ms=trial.pointer_delay_ms,
        expected_seconds=trial.expected_seconds,
    )


def assign(experiment: Experiment, seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, see `single_clips`."""

    def asked(rng: random.Random) -> int:
        return rng.randint(1, 2)

    return single_clips(experiment, seed, slot, asked)


KIND = Kind(
    declaration=WordChoice,
    answer=WordAnswer,
    view=View(
        "words",
        "Words: one row per play",
        answer_columns(base.CLIP, ANSWER),
        rows_of("word_choice", {"shown": "c"}),
    ),
    roles=("shown",),
    effects={
        "kind": "measured",
        "question": "measured",
        "first": "measured",
        "second": "measured",
        "pointer_delay_ms": "wording",
        "expected_seconds": "wording",
    },
    page=ShownWordChoice,
    shown=shown,
    assign=assign,
    block_size=block_size,
    shares_clips=True,
    example="""\
[trial]
kind = "word_choice"
question = { en = "Which word fits?", de = "Welches Wort passt?" }
first = { en = "awake", de = "wach" }
second = { en = "tired", de = "müde" }
pointer_delay_ms = 1500
expected_seconds = 5.0
""",
    check_response=lambda payload: {"first": 1, "second": 2}.get(str(payload.get("chosen"))),
)
