"""What a single-clip rating exports: the base columns and the rating itself, one row a scale and play.

A payload with one number is that of a [trial.scale]; one with `answers` has an object a scale.
"""

from experiments.columns import base, playback
from experiments.columns.column import Column
from experiments.columns.tables import rows_of
from experiments.columns.view import Dialect, View
from experiments.trials.clip_rating.scales import SCALE_NAME

ANSWER: tuple[Column, ...] = (
    Column(
        "response",
        "number",
        "The rating as it was chosen on the scale, reverse-keyed or not; empty where not_applicable was.",
        source="e.value",
        member="response",
    ),
    Column(
        "expected_response",
        "integer",
        "The answer asked for in an attention check, or right in a motion check.",
        source="a",
    ),
)

SCALE: tuple[Column, ...] = (
    Column(
        "scale",
        "text",
        "Name of the scale: rating where the study has one; empty in checks.",
        source="CASE WHEN a.kind IN ('attention', 'check') THEN NULL ELSE e.key END",
    ),
    Column(
        "not_applicable",
        "boolean",
        "True where the answer beside the scale (cannot say) was chosen.",
        source="e.value",
        member="not_applicable",
        otherwise="false",
    ),
    Column(
        "scale_rt",
        "number",
        "Response time from the clip's last frame to the answer on this scale, where there are several.",
        unit="ms",
        minimum=0,
        source="e.value",
        member="rt",
    ),
)

_EACH: dict[Dialect, str] = {
    "sqlite": "JOIN json_each(coalesce(json_extract(t.payload, '$.answers'), "
    f"json_object('{SCALE_NAME}', json(t.payload)))) e\n",
    "postgresql": "CROSS JOIN LATERAL json_each(coalesce(t.payload -> 'answers', "
    f"json_build_object('{SCALE_NAME}', t.payload))) e\n",
}


REFERENCE: tuple[Column, ...] = (
    Column(
        "reference",
        "text",
        "Cell of the reference clip shown before; empty where the study has none.",
        source="xc.cell",
    ),
    Column(
        "reference_gap_ms",
        "number",
        "From the last frame of the reference to the first of the rated clip, as they were drawn.",
        unit="ms",
        minimum=0,
        source="t.payload",
        member="reference_gap_ms",
    ),
)


def _rows(dialect: Dialect) -> str:
    return rows_of("clip_rating", {"shown": "c", "reference": "xc"}, _EACH[dialect])


RATINGS = View(
    name="ratings",
    title="Ratings: one row a play, or one a scale and play",
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
        *SCALE,
        *playback.VIEWS,
        *base.EVIDENCE,
        *base.CHECK,
        *playback.PRESENTATION,
        *REFERENCE,
    ),
    rows=_rows,
)
