"""The view `ratings` has a row a scale: its name, whether the answer beside it was chosen, and its own time."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None

# Frozen as of this revision; {response}, {further} and {also} differ from revision 0006, which is restored going down.
VIEW = """
CREATE VIEW ratings AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS phase,
       r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status AS
       run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, {levels} AS levels, c.cell AS cell, c.exemplar AS exemplar,
       c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256, {response} AS response,
       a.expected_response AS expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method, t.verdict
       AS verdict, t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms,
       t.frames_drawn AS frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing,
       t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS
       refresh_rate_hz, t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS
       exclusion_reason, {utc} AS saved_at, r.origin AS run_origin, v.number AS study_version, v.series AS
       data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms{further}
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id AND shown_clip.trial_index = t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
{also}WHERE t.kind = 'clip_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""
SPELLING = {
    "sqlite": {"utc": "replace(t.saved_at, ' ', 'T') || 'Z'", "levels": "c.levels"},
    "postgresql": {
        "utc": """to_char(t.saved_at AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"')""",
        "levels": "CAST(c.levels AS text)",
    },
}
BEFORE = {
    "sqlite": {"response": "json_extract(t.payload, '$.response')", "further": "", "also": ""},
    "postgresql": {"response": "CAST(t.payload ->> 'response' AS integer)", "further": "", "also": ""},
}
AFTER = {
    "sqlite": {
        "response": "json_extract(e.value, '$.response')",
        "further": """,
       CASE WHEN a.kind = 'attention' THEN NULL ELSE e.key END AS scale,
       coalesce(json_extract(e.value, '$.not_applicable'), false) AS not_applicable,
       json_extract(e.value, '$.rt') AS scale_rt""",
        "also": """JOIN json_each(coalesce(json_extract(t.payload, '$.answers'),
                    json_object('rating', json(t.payload)))) e
""",
    },
    "postgresql": {
        "response": "CAST(e.value ->> 'response' AS numeric)",
        "further": """,
       CASE WHEN a.kind = 'attention' THEN NULL ELSE e.key END AS scale,
       coalesce(CAST(e.value ->> 'not_applicable' AS boolean), false) AS not_applicable,
       CAST(e.value ->> 'rt' AS numeric) AS scale_rt""",
        "also": """CROSS JOIN LATERAL json_each(coalesce(t.payload -> 'answers',
                    json_build_object('rating', t.payload))) e
""",
    },
}
# Answers that the older program could not show: several scales, a slider, an answer beside the scale.
STORED = {
    "sqlite": "SELECT count(*) FROM trial_ratings WHERE kind = 'clip_rating' AND (json_type(payload, '$.answers') "
    "IS NOT NULL OR json_type(payload, '$.not_applicable') IS NOT NULL OR json_type(payload, '$.response') = 'real')",
    "postgresql": "SELECT count(*) FROM trial_ratings WHERE kind = 'clip_rating' AND (payload -> 'answers' IS NOT NULL "
    "OR payload -> 'not_applicable' IS NOT NULL OR payload ->> 'response' LIKE '%.%')",
}
DECLARED = {
    "sqlite": "SELECT count(*) FROM study_versions WHERE json_array_length(definition, '$.trial.scales') > 0",
    "postgresql": "SELECT count(*) FROM study_versions "
    "WHERE json_array_length(coalesce(definition -> 'trial' -> 'scales', '[]')) > 0",
}


def upgrade() -> None:
    dialect = op.get_bind().dialect.name
    op.execute("DROP VIEW ratings")
    op.execute(VIEW.format(**SPELLING[dialect], **AFTER[dialect]))


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    answers = op.get_bind().scalar(sa.text(STORED[dialect]))
    versions = op.get_bind().scalar(sa.text(DECLARED[dialect]))
    if answers or versions:
        raise RuntimeError(
            f"revision {down_revision} knows one scale of whole numbers a study only, and {versions} stored versions of "
            f"studies with {answers} answers have more; keep this revision, or take a backup and delete those first"
        )
    op.execute("DROP VIEW ratings")
    op.execute(VIEW.format(**SPELLING[dialect], **BEFORE[dialect]))
