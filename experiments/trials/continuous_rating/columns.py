"""What a continuous rating exports: the base columns and the trace, one row a play.

Alias beside those of the base columns: k clips.
"""

from experiments.columns import base, playback
from experiments.columns.column import Column
from experiments.columns.tables import rows_of
from experiments.columns.view import View

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
        "The answer asked for in an attention check (1 to 7), or right in a motion check.",
        source="a",
    ),
    Column(
        "trace",
        "text",
        "The rating at each sampled frame, a JSON list; sample k stands at frame k step_frames.",
        source="t.payload",
        member="values",
    ),
    Column(
        "step_frames",
        "integer",
        "Frames of the clip from one sample to the next.",
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
        "When the blinks of the clip's performance begin, a JSON list of seconds from its first frame; empty "
        "for other clips.",
        source="c",
        json=True,
    ),
)

TRACES = View(
    name="traces",
    title="Traces: one row a play of a clip",
    columns=(
        *base.STUDY,
        *base.RUN,
        *base.TRIAL,
        *base.CLIP,
        *ANSWER,
        *base.TIMES,
        *playback.PLAYBACK,
        *playback.SCREEN,
        *base.EXCLUSION,
        *base.SAVED,
        *base.ORIGIN,
        *playback.CLOCK,
        *playback.VIEWS,
        *base.CHECK,
        *playback.PRESENTATION,
        *base.EVIDENCE,
    ),
    rows=rows_of("continuous_rating", {"shown": "c"}, "LEFT JOIN clips k ON k.sha256 = c.clip_sha256\n"),
)
