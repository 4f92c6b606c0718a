"""A kind of trial of the tests' own: two clips one after the other, the same or not?

It stands for any kind added later: nothing outside this folder knows it but the line that registers it.
"""

import random
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from experiments import design
from experiments.assignment import Shown, Trial
from experiments.columns import Column, View
from experiments.columns.base import rows_of
from experiments.columns.playback import answer_columns
from experiments.declaration.base import Declaration, Translated
from experiments.declaration.trial import Answer, TrialDeclaration
from experiments.kinds.kind import Kind

if TYPE_CHECKING:
    from experiments.declaration.experiment import Experiment


class SameOrNot(TrialDeclaration):
    """Two clips in turn, and whether they looked alike."""

    kind: Literal["same_or_not"] = "same_or_not"
    question: Translated
    gap_ms: Annotated[int, Field(ge=0, le=5000)] = 500


class ShownSameOrNot(Declaration):
    kind: Literal["same_or_not"] = "same_or_not"
    question: Translated


def shown(experiment: "Experiment") -> ShownSameOrNot:
    assert isinstance(experiment.trial, SameOrNot)
    return ShownSameOrNot(question=experiment.trial.question)


class SameAnswer(Answer):
    kind: Literal["same_or_not"]
    same: bool


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """Every clip with its neighbour, in random order; slots take turns in which comes first."""
    clips = design.clips(experiment)
    pairs = list(pairwise(clips))
    random.Random(seed).shuffle(pairs)
    roles = ("first", "second") if slot % 2 == 0 else ("second", "first")
    return [
        Trial("main", block, "all", tuple(Shown(role, clip) for role, clip in zip(roles, pair, strict=True)))
        for block in range(1, experiment.blocks.repeats + 1)
        for pair in pairs
    ]


TOY = Kind(
    declaration=SameOrNot,
    answer=SameAnswer,
    view=View(
        name="sameness",
        title="Sameness: one row per pair",
        columns=answer_columns(
            shown=(Column("first_cell", "text", "Cell of the clip shown first.", source="one.cell"),),
            answer=(
                Column("same", "boolean", "True where they looked alike.", source="t.payload", member="same"),
            ),
        ),
        rows=rows_of("same_or_not", {"first": "one", "second": "two"}),
    ),
    roles=("first", "second"),
    effects={"question": "measured", "gap_ms": "measured", "expected_seconds": "wording"},
    page=ShownSameOrNot,
    shown=shown,
    assign=assign,
    block_size=lambda _, block: len(block.clips) - 1,
    example='[trial]\nkind = "same_or_not"\nquestion = { en = "The same?", de = "Gleich?" }\n',
)
