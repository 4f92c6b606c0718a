"""What a single-clip rating exports: the base columns and the rating itself, one row a play."""

from experiments.columns import base
from experiments.columns.column import Column
from experiments.columns.tables import rows_of
from experiments.columns.view import View

ANSWER: tuple[Column, ...] = (
    Column(
        "response", "integer", "The rating, on the declared scale.", source="t.payload", member="response"
    ),
    Column("expected_response", "integer", "The answer asked for in an attention check.", source="a"),
)

RATINGS = View(
    name="ratings",
    title="Ratings: one row a play",
    columns=(
        *base.STUDY,
        *base.RUN,
        *base.TRIAL,
        *base.CLIP,
        *ANSWER,
        *base.TIMES,
        *base.PLAYBACK,
        *base.SCREEN,
        *base.EXCLUSION,
        *base.SAVED,
        *base.ORIGIN,
        *base.CLOCK,
        *base.VIEWS,
    ),
    rows=rows_of("clip_rating", {"shown": "c"}),
)
