"""Motion checks: trials of the kind `check`, and the column `check_response` of every table of answers."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None

# Frozen as of this revision.
VIEWS = {
    ("ratings", "sqlite"): """
CREATE VIEW ratings AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256,
       r.phase AS phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS
       participant, r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS
       kind, a.block AS block, a.block_label AS block_label, t.play AS play, c.levels AS levels, c.cell AS
       cell, c.exemplar AS exemplar, c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS
       clip_sha256, json_extract(e.value, '$.response') AS response, a.expected_response AS
       expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS
       time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method, t.verdict AS verdict,
       t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS
       frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS
       longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS
       refresh_rate_hz, t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS
       exclusion_reason, replace(t.saved_at, ' ', 'T') || 'Z' AS saved_at, r.origin AS run_origin, v.number
       AS study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS
       clock_late_ms, CASE WHEN a.kind IN ('attention', 'check') THEN NULL ELSE e.key END AS scale,
       coalesce(json_extract(e.value, '$.not_applicable'), false) AS not_applicable, json_extract(e.value,
       '$.rt') AS scale_rt, nullif((SELECT count(*) FROM views w WHERE w.study_run_id = t.study_run_id AND
       w.trial_index = t.trial_index AND w.play <= t.play), 0) AS views, (SELECT group_concat(o.outcome,
       ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE 'begun' END) AS
       outcome FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index AND
       w.play = t.play ORDER BY w.number) o) AS view_outcomes, t.disturbances AS disturbances,
       coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict,
       json_extract(t.payload, '$.check') AS check_response
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id AND shown_clip.trial_index = t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
JOIN json_each(coalesce(json_extract(t.payload, '$.answers'), json_object('rating', json(t.payload)))) e
WHERE t.kind = 'clip_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
""",
    ("ratings", "postgresql"): """
CREATE VIEW ratings AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256,
       r.phase AS phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS
       participant, r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS
       kind, a.block AS block, a.block_label AS block_label, t.play AS play, CAST(c.levels AS text) AS
       levels, c.cell AS cell, c.exemplar AS exemplar, c.profile_id AS profile_id, c.file AS stimulus,
       c.clip_sha256 AS clip_sha256, CAST(e.value ->> 'response' AS numeric) AS response,
       a.expected_response AS expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method,
       t.verdict AS verdict, t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS
       key_to_first_frame_ms, t.frames_drawn AS frames_drawn, t.frames_late AS frames_late,
       t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls,
       t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS
       device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded, r.exclusion_reason AS exclusion_reason, to_char(t.saved_at AT TIME ZONE
       'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at, r.origin AS run_origin, v.number AS
       study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS
       clock_late_ms, CASE WHEN a.kind IN ('attention', 'check') THEN NULL ELSE e.key END AS scale,
       coalesce(CAST(e.value ->> 'not_applicable' AS boolean), false) AS not_applicable, CAST(e.value ->>
       'rt' AS numeric) AS scale_rt, nullif((SELECT count(*) FROM views w WHERE w.study_run_id =
       t.study_run_id AND w.trial_index = t.trial_index AND w.play <= t.play), 0) AS views, (SELECT
       string_agg(o.outcome, ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE
       'begun' END) AS outcome FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index =
       t.trial_index AND w.play = t.play ORDER BY w.number) o) AS view_outcomes, CAST(t.disturbances AS
       text) AS disturbances, coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict,
       CAST(t.payload ->> 'check' AS integer) AS check_response
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id AND shown_clip.trial_index = t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
CROSS JOIN LATERAL json_each(coalesce(t.payload -> 'answers', json_build_object('rating', t.payload))) e
WHERE t.kind = 'clip_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
""",
    ("comparisons", "sqlite"): """
CREATE VIEW comparisons AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256,
       r.phase AS phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS
       participant, r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS
       kind, a.block AS block, a.block_label AS block_label, t.play AS play, coalesce(lc.cell, fc.cell) AS
       left_cell, coalesce(lc.exemplar, fc.exemplar) AS left_exemplar, coalesce(lc.file, fc.file) AS
       left_stimulus, coalesce(lc.clip_sha256, fc.clip_sha256) AS left_clip_sha256, coalesce(rc.cell,
       sc.cell) AS right_cell, coalesce(rc.exemplar, sc.exemplar) AS right_exemplar, coalesce(rc.file,
       sc.file) AS right_stimulus, coalesce(rc.clip_sha256, sc.clip_sha256) AS right_clip_sha256, xc.cell
       AS reference, json_extract(t.payload, '$.winner') AS winner, json_extract(t.payload,
       '$.arrangement') AS arrangement, a.expected_response AS expected_response, t.rt AS rt,
       t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS time_elapsed, t.changes AS changes,
       t.comment AS comment, t.method AS method, t.verdict AS verdict, t.verdict_rule AS verdict_rule,
       t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS frames_drawn, t.frames_late AS
       frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms, t.stalls AS
       stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS
       device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded, r.exclusion_reason AS exclusion_reason, replace(t.saved_at, ' ', 'T') || 'Z'
       AS saved_at, r.origin AS run_origin, v.number AS study_version, v.series AS data_series,
       t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms, nullif((SELECT count(*) FROM views
       w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index AND w.play <= t.play), 0)
       AS views, (SELECT group_concat(o.outcome, ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN
       w.completed THEN 'shown' ELSE 'begun' END) AS outcome FROM views w WHERE w.study_run_id =
       t.study_run_id AND w.trial_index = t.trial_index AND w.play = t.play ORDER BY w.number) o) AS
       view_outcomes, t.disturbances AS disturbances, coalesce(r.evidence_verdict, 'not_judged') AS
       evidence_verdict,
       json_extract(t.payload, '$.check') AS check_response
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
""",
    ("comparisons", "postgresql"): """
CREATE VIEW comparisons AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256,
       r.phase AS phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS
       participant, r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS
       kind, a.block AS block, a.block_label AS block_label, t.play AS play, coalesce(lc.cell, fc.cell) AS
       left_cell, coalesce(lc.exemplar, fc.exemplar) AS left_exemplar, coalesce(lc.file, fc.file) AS
       left_stimulus, coalesce(lc.clip_sha256, fc.clip_sha256) AS left_clip_sha256, coalesce(rc.cell,
       sc.cell) AS right_cell, coalesce(rc.exemplar, sc.exemplar) AS right_exemplar, coalesce(rc.file,
       sc.file) AS right_stimulus, coalesce(rc.clip_sha256, sc.clip_sha256) AS right_clip_sha256, xc.cell
       AS reference, t.payload ->> 'winner' AS winner, t.payload ->> 'arrangement' AS arrangement,
       a.expected_response AS expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method,
       t.verdict AS verdict, t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS
       key_to_first_frame_ms, t.frames_drawn AS frames_drawn, t.frames_late AS frames_late,
       t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls,
       t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS
       device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded, r.exclusion_reason AS exclusion_reason, to_char(t.saved_at AT TIME ZONE
       'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at, r.origin AS run_origin, v.number AS
       study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS
       clock_late_ms, nullif((SELECT count(*) FROM views w WHERE w.study_run_id = t.study_run_id AND
       w.trial_index = t.trial_index AND w.play <= t.play), 0) AS views, (SELECT string_agg(o.outcome, ' ')
       FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE 'begun' END) AS outcome
       FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index AND w.play =
       t.play ORDER BY w.number) o) AS view_outcomes, CAST(t.disturbances AS text) AS disturbances,
       coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict,
       CAST(t.payload ->> 'check' AS integer) AS check_response
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
""",
    ("thresholds", "sqlite"): """
CREATE VIEW thresholds AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256,
       r.phase AS phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS
       participant, r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS
       kind, a.block AS block, a.block_label AS block_label, t.play AS play, q.series AS series, q.position
       AS position, w.value AS value, q.role AS interval, c.levels AS levels, c.cell AS cell, c.exemplar AS
       exemplar, c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256,
       json_extract(t.payload, '$.chosen') AS response, w.correct AS correct, a.expected_response AS
       expected_response, w.counts AS counts, w.known AS known, w.ahead AS ahead, w.threshold AS threshold,
       w.threshold_sd AS threshold_sd, w.spread AS spread, w.entropy AS entropy, t.rt AS rt,
       t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS time_elapsed, t.changes AS changes,
       t.comment AS comment, t.method AS method, t.verdict AS verdict, t.verdict_rule AS verdict_rule,
       t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS frames_drawn, t.frames_late AS
       frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms, t.stalls AS
       stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS
       device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded, r.exclusion_reason AS exclusion_reason, replace(t.saved_at, ' ', 'T') || 'Z'
       AS saved_at, r.origin AS run_origin, v.number AS study_version, v.series AS data_series,
       t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms, nullif((SELECT count(*) FROM views
       w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index AND w.play <= t.play), 0)
       AS views, (SELECT group_concat(o.outcome, ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN
       w.completed THEN 'shown' ELSE 'begun' END) AS outcome FROM views w WHERE w.study_run_id =
       t.study_run_id AND w.trial_index = t.trial_index AND w.play = t.play ORDER BY w.number) o) AS
       view_outcomes, t.disturbances AS disturbances, coalesce(r.evidence_verdict, 'not_judged') AS
       evidence_verdict,
       json_extract(t.payload, '$.check') AS check_response
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN series_trials q ON q.study_run_id = t.study_run_id AND q.trial_index = t.trial_index
LEFT JOIN series_answers w ON w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
    AND w.play = t.play
LEFT JOIN version_clips c ON c.id = w.version_clip_id
WHERE t.kind = 'threshold' AND r.origin <> 'preview' AND r.erased_at IS NULL
""",
    ("thresholds", "postgresql"): """
CREATE VIEW thresholds AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256,
       r.phase AS phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS
       participant, r.status AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS
       kind, a.block AS block, a.block_label AS block_label, t.play AS play, q.series AS series, q.position
       AS position, w.value AS value, q.role AS interval, CAST(c.levels AS text) AS levels, c.cell AS cell,
       c.exemplar AS exemplar, c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS
       clip_sha256, t.payload ->> 'chosen' AS response, w.correct AS correct, a.expected_response AS
       expected_response, w.counts AS counts, w.known AS known, w.ahead AS ahead, w.threshold AS threshold,
       w.threshold_sd AS threshold_sd, w.spread AS spread, w.entropy AS entropy, t.rt AS rt,
       t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed AS time_elapsed, t.changes AS changes,
       t.comment AS comment, t.method AS method, t.verdict AS verdict, t.verdict_rule AS verdict_rule,
       t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS frames_drawn, t.frames_late AS
       frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS longest_gap_ms, t.stalls AS
       stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS
       device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded, r.exclusion_reason AS exclusion_reason, to_char(t.saved_at AT TIME ZONE
       'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at, r.origin AS run_origin, v.number AS
       study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS
       clock_late_ms, nullif((SELECT count(*) FROM views w WHERE w.study_run_id = t.study_run_id AND
       w.trial_index = t.trial_index AND w.play <= t.play), 0) AS views, (SELECT string_agg(o.outcome, ' ')
       FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE 'begun' END) AS outcome
       FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index AND w.play =
       t.play ORDER BY w.number) o) AS view_outcomes, CAST(t.disturbances AS text) AS disturbances,
       coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict,
       CAST(t.payload ->> 'check' AS integer) AS check_response
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN series_trials q ON q.study_run_id = t.study_run_id AND q.trial_index = t.trial_index
LEFT JOIN series_answers w ON w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
    AND w.play = t.play
LEFT JOIN version_clips c ON c.id = w.version_clip_id
WHERE t.kind = 'threshold' AND r.origin <> 'preview' AND r.erased_at IS NULL
""",
    ("traces", "sqlite"): """
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
       w.number) o) AS view_outcomes, t.disturbances AS disturbances,
       json_extract(t.payload, '$.check') AS check_response
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
""",
    ("traces", "postgresql"): """
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
       text) AS disturbances,
       CAST(t.payload ->> 'check' AS integer) AS check_response
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
""",
}
FURTHER = {
    "sqlite": ",\n       json_extract(t.payload, '$.check') AS check_response",
    "postgresql": ",\n       CAST(t.payload ->> 'check' AS integer) AS check_response",
}
NAMES = ("ratings", "comparisons", "thresholds", "traces")
NO_SCALE = ("IN ('attention', 'check')", "= 'attention'")
BEFORE, AFTER = ("practice", "main", "attention"), ("practice", "main", "attention", "check")
ANSWERED = """
SELECT 1 FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
WHERE a.kind = 'check' LIMIT 1
"""
CHECK = "ck_assigned_trials_kind_known"


def upgrade() -> None:
    _drop_views()
    _allow(AFTER)
    for name in NAMES:
        op.execute(VIEWS[name, op.get_bind().dialect.name])


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    if op.get_bind().execute(sa.text(ANSWERED)).scalar():
        raise RuntimeError(
            "Answers to motion checks are stored; export them, and delete their studies, before going back."
        )
    _drop_views()
    # An earlier program knows no motion checks, nor clips without a cell.
    gone = "SELECT 1 FROM assigned_trials a WHERE a.kind = 'check' AND a.study_run_id = {0}.study_run_id"
    for table in ("answer_evidence", "trial_ratings", "views", "trial_clips"):
        op.execute(f"DELETE FROM {table} WHERE EXISTS ({gone.format(table)} AND a.trial_index = {table}.trial_index)")
    op.execute("DELETE FROM assigned_trials WHERE kind = 'check'")
    op.execute("DELETE FROM version_clips WHERE cell = ''")
    _allow(BEFORE)
    for name in NAMES:
        op.execute(VIEWS[name, dialect].replace(FURTHER[dialect], "").replace(*NO_SCALE))


def _drop_views() -> None:
    for name in NAMES:
        op.execute(f"DROP VIEW {name}")


def _allow(kinds: tuple[str, ...]) -> None:
    """Let a trial be of these kinds.

    Making the table anew would cascade to every answer in SQLite. The constraint is changed in the table's text
    instead, as SQLite's documentation of ALTER TABLE describes it for changes that leave the rows as they are.
    """
    words = ", ".join(f"'{kind}'" for kind in kinds)
    bind = op.get_bind()
    if bind.dialect.name != "sqlite":
        op.drop_constraint(op.f(CHECK), "assigned_trials", type_="check")
        op.create_check_constraint(op.f(CHECK), "assigned_trials", sa.text(f"kind IN ({words})"))
        return
    text = bind.scalar(sa.text("SELECT sql FROM sqlite_schema WHERE name = 'assigned_trials'"))
    changed, times = re.subn(r"kind IN \('practice', 'main', 'attention'(?:, 'check')?\)", f"kind IN ({words})", text)
    if times != 1:
        raise RuntimeError("the table assigned_trials is not as the revision before made it; nothing was changed")
    bind.execute(sa.text("PRAGMA writable_schema = ON"))
    bind.execute(sa.text("UPDATE sqlite_schema SET sql = :sql WHERE name = 'assigned_trials'"), {"sql": changed})
    bind.execute(sa.text("PRAGMA writable_schema = RESET"))
