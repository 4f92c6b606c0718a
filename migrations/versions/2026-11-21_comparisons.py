"""The view of paired comparisons."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

# Frozen as of this revision.
SQLITE = """
CREATE VIEW comparisons AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS phase,
       r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status AS
       run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, coalesce(lc.cell, fc.cell) AS left_cell,
       coalesce(lc.exemplar, fc.exemplar) AS left_exemplar, coalesce(lc.file, fc.file) AS left_stimulus,
       coalesce(lc.clip_sha256, fc.clip_sha256) AS left_clip_sha256, coalesce(rc.cell, sc.cell) AS right_cell,
       coalesce(rc.exemplar, sc.exemplar) AS right_exemplar, coalesce(rc.file, sc.file) AS right_stimulus,
       coalesce(rc.clip_sha256, sc.clip_sha256) AS right_clip_sha256, xc.cell AS reference,
       json_extract(t.payload, '$.winner') AS winner, json_extract(t.payload, '$.arrangement') AS arrangement,
       a.expected_response AS expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method, t.verdict
       AS verdict, t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms,
       t.frames_drawn AS frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing,
       t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS
       refresh_rate_hz, t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS
       exclusion_reason, replace(t.saved_at, ' ', 'T') || 'Z' AS saved_at, r.origin AS run_origin, v.number AS
       study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips left_clip ON left_clip.study_run_id = t.study_run_id AND left_clip.trial_index = t.trial_index AND left_clip.role = 'left'
LEFT JOIN version_clips lc ON lc.id = left_clip.version_clip_id
LEFT JOIN trial_clips right_clip ON right_clip.study_run_id = t.study_run_id AND right_clip.trial_index = t.trial_index AND right_clip.role = 'right'
LEFT JOIN version_clips rc ON rc.id = right_clip.version_clip_id
LEFT JOIN trial_clips first_clip ON first_clip.study_run_id = t.study_run_id AND first_clip.trial_index = t.trial_index AND first_clip.role = 'first'
LEFT JOIN version_clips fc ON fc.id = first_clip.version_clip_id
LEFT JOIN trial_clips second_clip ON second_clip.study_run_id = t.study_run_id AND second_clip.trial_index = t.trial_index AND second_clip.role = 'second'
LEFT JOIN version_clips sc ON sc.id = second_clip.version_clip_id
LEFT JOIN trial_clips reference_clip ON reference_clip.study_run_id = t.study_run_id AND reference_clip.trial_index = t.trial_index AND reference_clip.role = 'reference'
LEFT JOIN version_clips xc ON xc.id = reference_clip.version_clip_id
WHERE t.kind = 'paired_comparison' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""
POSTGRESQL = """
CREATE VIEW comparisons AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS phase,
       r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status AS
       run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, coalesce(lc.cell, fc.cell) AS left_cell,
       coalesce(lc.exemplar, fc.exemplar) AS left_exemplar, coalesce(lc.file, fc.file) AS left_stimulus,
       coalesce(lc.clip_sha256, fc.clip_sha256) AS left_clip_sha256, coalesce(rc.cell, sc.cell) AS right_cell,
       coalesce(rc.exemplar, sc.exemplar) AS right_exemplar, coalesce(rc.file, sc.file) AS right_stimulus,
       coalesce(rc.clip_sha256, sc.clip_sha256) AS right_clip_sha256, xc.cell AS reference, t.payload ->>
       'winner' AS winner, t.payload ->> 'arrangement' AS arrangement, a.expected_response AS expected_response,
       t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS time_elapsed, t.changes AS
       changes, t.comment AS comment, t.method AS method, t.verdict AS verdict, t.verdict_rule AS verdict_rule,
       t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS frames_drawn, t.frames_late AS
       frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls,
       t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS
       device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS viewing_distance_mm, r.excluded AS
       excluded, r.exclusion_reason AS exclusion_reason, to_char(t.saved_at AT TIME ZONE 'UTC',
       'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at, r.origin AS run_origin, v.number AS study_version, v.series
       AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips left_clip ON left_clip.study_run_id = t.study_run_id AND left_clip.trial_index = t.trial_index AND left_clip.role = 'left'
LEFT JOIN version_clips lc ON lc.id = left_clip.version_clip_id
LEFT JOIN trial_clips right_clip ON right_clip.study_run_id = t.study_run_id AND right_clip.trial_index = t.trial_index AND right_clip.role = 'right'
LEFT JOIN version_clips rc ON rc.id = right_clip.version_clip_id
LEFT JOIN trial_clips first_clip ON first_clip.study_run_id = t.study_run_id AND first_clip.trial_index = t.trial_index AND first_clip.role = 'first'
LEFT JOIN version_clips fc ON fc.id = first_clip.version_clip_id
LEFT JOIN trial_clips second_clip ON second_clip.study_run_id = t.study_run_id AND second_clip.trial_index = t.trial_index AND second_clip.role = 'second'
LEFT JOIN version_clips sc ON sc.id = second_clip.version_clip_id
LEFT JOIN trial_clips reference_clip ON reference_clip.study_run_id = t.study_run_id AND reference_clip.trial_index = t.trial_index AND reference_clip.role = 'reference'
LEFT JOIN version_clips xc ON xc.id = reference_clip.version_clip_id
WHERE t.kind = 'paired_comparison' AND r.origin <> 'preview' AND r.erased_at IS NULL
"""


def upgrade() -> None:
    op.execute(SQLITE if op.get_bind().dialect.name == "sqlite" else POSTGRESQL)


def downgrade() -> None:
    stored = op.get_bind().scalar(sa.text("SELECT count(*) FROM trial_ratings WHERE kind = 'paired_comparison'"))
    if stored:
        raise RuntimeError(
            f"revision {down_revision} has no view of the {stored} comparisons that are stored; keep this revision, or "
            "take a backup and delete the runs of these studies first"
        )
    op.execute("DROP VIEW comparisons")
