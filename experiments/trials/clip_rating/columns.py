"""What a single-clip rating exports: the base columns and the rating itself, one row a play."""

from experiments.columns import base
from experiments.columns.column import Column
from experiments.columns.view import View

ANSWER: tuple[Column, ...] = (
    Column("response", "integer", "The rating, on the declared scale.", source="t"),
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
    ),
    rows="""FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN version_clips c ON c.id = a.version_clip_id
WHERE r.origin <> 'preview' AND r.erased_at IS NULL
""",
)
