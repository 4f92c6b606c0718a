"""`onset_delay_ms` without the time for which the bench held its key: two refreshes less (decision 0835)."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0032"
down_revision = "0031"
branch_labels = None
depends_on = None

BEFORE = {"Firefox": 3, "Chrome": 2}
AFTER = {"Firefox": 1, "Chrome": 0}
OTHERS = ("comparisons", "thresholds", "traces")
# Frozen as of this revision: PostgreSQL does not keep an IN as it was written, so that this view is not made of its own text.
RATINGS = {
    "sqlite": """
CREATE VIEW ratings AS
SELECT s.name AS study,
       v.experiment AS experiment,
       v.definition_sha256 AS definition_sha256,
       r.phase AS phase,
       r.origin = 'simulated' AS synthetic,
       r.public_id AS run,
       r.participant AS participant,
       r.status AS run_status,
       r.language AS language,
       a.trial_index AS trial_index,
       a.kind AS kind,
       a.block AS block,
       a.block_label AS block_label,
       t.play AS play,
       c.levels AS levels,
       c.cell AS cell,
       c.exemplar AS exemplar,
       c.profile_id AS profile_id,
       c.file AS stimulus,
       c.clip_sha256 AS clip_sha256,
       json_extract(e.value, '$.response') AS response,
       a.expected_response AS expected_response,
       t.rt AS rt,
       t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed,
       t.changes AS changes,
       t.comment AS comment,
       t.method AS method,
       t.verdict AS verdict,
       t.verdict_rule AS verdict_rule,
       t.key_to_first_frame_ms AS key_to_first_frame_ms,
       t.frames_drawn AS frames_drawn,
       t.frames_late AS frames_late,
       t.frames_missing AS frames_missing,
       t.longest_gap_ms AS longest_gap_ms,
       t.stalls AS stalls,
       t.focus_lost AS focus_lost,
       t.refresh_rate_hz AS refresh_rate_hz,
       t.device_pixel_ratio AS device_pixel_ratio,
       t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded,
       r.exclusion_reason AS exclusion_reason,
       replace(t.saved_at, ' ', 'T') || 'Z' AS saved_at,
       r.origin AS run_origin,
       v.number AS study_version,
       v.series AS data_series,
       t.clock_gap_ms AS clock_gap_ms,
       t.clock_late_ms AS clock_late_ms,
       CASE WHEN a.kind IN ('attention', 'check') THEN NULL ELSE e.key END AS scale,
       coalesce(json_extract(e.value, '$.not_applicable'), false) AS not_applicable,
       json_extract(e.value, '$.rt') AS scale_rt,
       nullif((SELECT count(*) FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
       AND w.play <= t.play), 0) AS views,
       (SELECT group_concat(o.outcome, ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE
       'begun' END) AS outcome FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
       AND w.play = t.play ORDER BY w.number) o) AS view_outcomes,
       t.disturbances AS disturbances,
       coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict,
       json_extract(t.payload, '$.check') AS check_response,
       CASE WHEN t.method = 'webcodecs' THEN CAST(round(CAST((CASE WHEN CAST(r.device AS text) LIKE '%Firefox/%' THEN
       {firefox} WHEN CAST(r.device AS text) LIKE '%Chrome/%' THEN {chromium} END) * 1000.0 / coalesce(t.refresh_rate_hz, 60) AS
       numeric), 2) AS double precision) END AS onset_delay_ms,
       CASE WHEN t.method = 'webcodecs' AND t.verdict = 'good' THEN CAST(round(CAST(1000.0 /
       coalesce(t.refresh_rate_hz, 60) AS numeric), 2) AS double precision) END AS onset_uncertainty_ms,
       xc.cell AS reference,
       json_extract(t.payload, '$.reference_gap_ms') AS reference_gap_ms
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id AND shown_clip.trial_index =
       t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
LEFT JOIN trial_clips reference_clip ON reference_clip.study_run_id = t.study_run_id AND reference_clip.trial_index =
       t.trial_index AND reference_clip.role = 'reference'
LEFT JOIN version_clips xc ON xc.id = reference_clip.version_clip_id
JOIN json_each(coalesce(json_extract(t.payload, '$.answers'), json_object('rating', json(t.payload)))) e
WHERE t.kind = 'clip_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
""",
    "postgresql": """
CREATE VIEW ratings AS
SELECT s.name AS study,
       v.experiment AS experiment,
       v.definition_sha256 AS definition_sha256,
       r.phase AS phase,
       r.origin = 'simulated' AS synthetic,
       r.public_id AS run,
       r.participant AS participant,
       r.status AS run_status,
       r.language AS language,
       a.trial_index AS trial_index,
       a.kind AS kind,
       a.block AS block,
       a.block_label AS block_label,
       t.play AS play,
       CAST(c.levels AS text) AS levels,
       c.cell AS cell,
       c.exemplar AS exemplar,
       c.profile_id AS profile_id,
       c.file AS stimulus,
       c.clip_sha256 AS clip_sha256,
       CAST(e.value ->> 'response' AS numeric) AS response,
       a.expected_response AS expected_response,
       t.rt AS rt,
       t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed,
       t.changes AS changes,
       t.comment AS comment,
       t.method AS method,
       t.verdict AS verdict,
       t.verdict_rule AS verdict_rule,
       t.key_to_first_frame_ms AS key_to_first_frame_ms,
       t.frames_drawn AS frames_drawn,
       t.frames_late AS frames_late,
       t.frames_missing AS frames_missing,
       t.longest_gap_ms AS longest_gap_ms,
       t.stalls AS stalls,
       t.focus_lost AS focus_lost,
       t.refresh_rate_hz AS refresh_rate_hz,
       t.device_pixel_ratio AS device_pixel_ratio,
       t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm,
       r.excluded AS excluded,
       r.exclusion_reason AS exclusion_reason,
       to_char(t.saved_at AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at,
       r.origin AS run_origin,
       v.number AS study_version,
       v.series AS data_series,
       t.clock_gap_ms AS clock_gap_ms,
       t.clock_late_ms AS clock_late_ms,
       CASE WHEN a.kind IN ('attention', 'check') THEN NULL ELSE e.key END AS scale,
       coalesce(CAST(e.value ->> 'not_applicable' AS boolean), false) AS not_applicable,
       CAST(e.value ->> 'rt' AS numeric) AS scale_rt,
       nullif((SELECT count(*) FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
       AND w.play <= t.play), 0) AS views,
       (SELECT string_agg(o.outcome, ' ') FROM (SELECT coalesce(w.outcome, CASE WHEN w.completed THEN 'shown' ELSE
       'begun' END) AS outcome FROM views w WHERE w.study_run_id = t.study_run_id AND w.trial_index = t.trial_index
       AND w.play = t.play ORDER BY w.number) o) AS view_outcomes,
       CAST(t.disturbances AS text) AS disturbances,
       coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict,
       CAST(t.payload ->> 'check' AS integer) AS check_response,
       CASE WHEN t.method = 'webcodecs' THEN CAST(round(CAST((CASE WHEN CAST(r.device AS text) LIKE '%Firefox/%' THEN
       {firefox} WHEN CAST(r.device AS text) LIKE '%Chrome/%' THEN {chromium} END) * 1000.0 / coalesce(t.refresh_rate_hz, 60) AS
       numeric), 2) AS double precision) END AS onset_delay_ms,
       CASE WHEN t.method = 'webcodecs' AND t.verdict = 'good' THEN CAST(round(CAST(1000.0 /
       coalesce(t.refresh_rate_hz, 60) AS numeric), 2) AS double precision) END AS onset_uncertainty_ms,
       xc.cell AS reference,
       CAST(t.payload ->> 'reference_gap_ms' AS numeric) AS reference_gap_ms
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id AND shown_clip.trial_index =
       t.trial_index AND shown_clip.role = 'shown'
LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id
LEFT JOIN trial_clips reference_clip ON reference_clip.study_run_id = t.study_run_id AND reference_clip.trial_index =
       t.trial_index AND reference_clip.role = 'reference'
LEFT JOIN version_clips xc ON xc.id = reference_clip.version_clip_id
CROSS JOIN LATERAL json_each(coalesce(t.payload -> 'answers', json_build_object('rating', t.payload))) e
WHERE t.kind = 'clip_rating' AND r.origin <> 'preview' AND r.erased_at IS NULL
""",
}


def upgrade() -> None:
    """Make each view of answers anew, with the delays as measured from the press."""
    _make(AFTER)


def downgrade() -> None:
    """Make each view of answers anew with the delays of before."""
    _make(BEFORE)


def _make(refreshes: dict[str, int]) -> None:
    ratings = RATINGS[op.get_bind().dialect.name]
    op.execute("DROP VIEW ratings")
    op.execute(ratings.replace("{firefox}", str(refreshes["Firefox"])).replace("{chromium}", str(refreshes["Chrome"])))
    for name in OTHERS:
        query = _query(name)
        for browser, count in refreshes.items():
            # PostgreSQL writes the pattern as '%Firefox/%'::text, in words of its own around it.
            query, found = re.subn(rf"('%{browser}/%'[^']*?\bTHEN\s+)\d", rf"\g<1>{count}", query)
            if found != 1:
                raise RuntimeError(f"the view {name} tells the delay of {browser} {found} times, not once")
        op.execute(sa.text(f"DROP VIEW {name}"))
        op.execute(sa.text(f"CREATE VIEW {name} AS{query}".replace(":", r"\:")))


def _query(name: str) -> str:
    """What the view selects, as the database keeps it."""
    connection = op.get_bind()
    if connection.dialect.name == "sqlite":
        query = sa.text("SELECT sql FROM sqlite_master WHERE type = 'view' AND name = :name")
        return str(connection.scalar(query, {"name": name})).split(" AS", 1)[1]
    query = sa.text("SELECT pg_get_viewdef(CAST(:name AS regclass), true)")
    return str(connection.scalar(query, {"name": name})).rstrip().rstrip(";")
