"""What a comparison exports: the base columns, both clips and the one chosen, one row a showing of a pair.

Where two clips come one after the other, the first is the left one.
"""

from experiments.columns import base, playback
from experiments.columns.column import Column
from experiments.columns.tables import rows_of
from experiments.columns.view import View

_ROLES = {"left": "lc", "right": "rc", "first": "fc", "second": "sc", "reference": "xc"}


def _side(side: str, one: str, other: str) -> tuple[Column, ...]:
    def either(column: str) -> str:
        return f"coalesce({one}.{column}, {other}.{column})"

    return (
        Column(
            f"{side}_cell",
            "text",
            f"Cell of the {side} clip: level names, joined by slashes.",
            source=either("cell"),
        ),
        Column(
            f"{side}_exemplar",
            "integer",
            f"Which exemplar of its cell the {side} clip is, from 1.",
            minimum=1,
            source=either("exemplar"),
        ),
        Column(f"{side}_stimulus", "text", f"File name of the {side} clip.", source=either("file")),
        Column(
            f"{side}_clip_sha256",
            "text",
            f"SHA-256 of the bytes of the {side} clip.",
            source=either("clip_sha256"),
        ),
    )


ANSWER: tuple[Column, ...] = (
    Column(
        "winner",
        "text",
        "The clip chosen, or tie.",
        values=("left", "right", "tie"),
        source="t.payload",
        member="winner",
    ),
    Column(
        "arrangement",
        "text",
        "How the two were shown: beside or above one another at once, or in turn (left is then the first).",
        values=("side_by_side", "stacked", "one_after_the_other"),
        source="t.payload",
        member="arrangement",
    ),
    Column(
        "expected_response",
        "integer",
        "The answer asked for in an attention check (1 left or first, 2 right or second, 3 tie), or right in "
        "a motion check.",
        source="a",
    ),
)

COMPARISONS = View(
    name="comparisons",
    title="Comparisons: one row a showing of a pair",
    columns=(
        *base.STUDY,
        *base.RUN,
        *base.TRIAL,
        *_side("left", "lc", "fc"),
        *_side("right", "rc", "sc"),
        Column("reference", "text", "Cell of the reference clip shown before.", source="xc.cell"),
        *ANSWER,
        *base.TIMES,
        *playback.PLAYBACK,
        *playback.SCREEN,
        *base.EXCLUSION,
        *base.SAVED,
        *base.ORIGIN,
        *playback.CLOCK,
        *playback.VIEWS,
        *base.EVIDENCE,
        *base.CHECK,
        *playback.PRESENTATION,
    ),
    rows=rows_of("paired_comparison", _ROLES),
)
