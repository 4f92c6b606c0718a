"""Traces of continuous ratings as a view, and when the blinks of a performance's clip begin."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None

# Frozen as of this revision.
SQLITE = """
CREATE VIEW traces AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS
       phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant,
       r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block
       AS block, a.block_label AS block_label, t.play AS play, c.levels AS levels, c.cell AS cell,
       c.exemplar AS exemplar, c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256,
       json_extract(t.payload, '$.response') AS response, a.expected_response AS expected_response,
       json_extract(t.payload, '$.values') AS trace, json_extract(t.payload, '$.step_frames') AS
       step_frames, k.fps AS clip_fps, json_extract(t.payload, '$.moves') AS moves, c.blinks_s AS blinks_s,
       t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS time_elapsed, t.changes
       AS changes, t.comment AS comment, t.method AS method, t.verdict AS verdict, t.verdict_rule AS
       verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS frames_drawn,
       t.frames_late AS frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms,
       t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz,
       t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS
       viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS exclusion_reason,
       replace(t.saved_at, ' ', 'T') || 'Z' AS saved_at, r.origin AS run_origin, v.number AS study_version,
       v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms,
       nullif((SELECT count(*) FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index =
       t.trial_index AND w.play <= t.play), 0) AS views, (SELECT group_concat(o.outcome, ' ') FROM (SELECT
       coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE 'begun' END) AS outcome FROM views w
       WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index AND w.play = t.play ORDER BY
       w.number) o) AS view_outcomes, t.disturbances AS disturbances
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id
    AND shown_clip.trial_index = t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
LEFT JOIN clips k ON k.sha256 = c.clip_sha256
WHERE t.kind = 'continuous_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""
POSTGRESQL = """
CREATE VIEW traces AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS
       phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant,
       r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block
       AS block, a.block_label AS block_label, t.play AS play, CAST(c.levels AS text) AS levels, c.cell AS
       cell, c.exemplar AS exemplar, c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS
       clip_sha256, CAST(t.payload ->> 'response' AS numeric) AS response, a.expected_response AS
       expected_response, t.payload ->> 'values' AS trace, CAST(t.payload ->> 'step_frames' AS integer) AS
       step_frames, k.fps AS clip_fps, CAST(t.payload ->> 'moves' AS integer) AS moves, CAST(c.blinks_s AS
       text) AS blinks_s, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS
       time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method, t.verdict AS verdict,
       t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS
       frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS
       longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz,
       t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS
       viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS exclusion_reason,
       to_char(t.saved_at AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at, r.origin AS
       run_origin, v.number AS study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms,
       t.clock_late_ms AS clock_late_ms, nullif((SELECT count(*) FROM views w WHERE w.study_run_id =
       t.study_run_id AND w.trial_index = t.trial_index AND w.play <= t.play), 0) AS views, (SELECT
       string_agg(o.outcome, ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE
       'begun' END) AS outcome FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index =
       t.trial_index AND w.play = t.play ORDER BY w.number) o) AS view_outcomes, CAST(t.disturbances AS
       text) AS disturbances
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id
    AND shown_clip.trial_index = t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
LEFT JOIN clips k ON k.sha256 = c.clip_sha256
WHERE t.kind = 'continuous_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""


def upgrade() -> None:
    op.add_column("version_clips", sa.Column("blinks_s", sa.JSON(none_as_null=True), nullable=True))
    op.execute(SQLITE if op.get_bind().dialect.name == "sqlite" else POSTGRESQL)


def downgrade() -> None:
    stored = "SELECT 1 FROM trial_ratings WHERE kind = 'continuous_rating' LIMIT 1"
    if op.get_bind().execute(sa.text(stored)).scalar():
        raise RuntimeError(
            "Continuous ratings are stored; export them, and delete their studies, before going back."
        )
    op.execute("DROP VIEW traces")
    op.drop_column("version_clips", "blinks_s")
