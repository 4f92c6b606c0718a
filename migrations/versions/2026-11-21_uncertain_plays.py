"""Verdict `uncertain`, and how evenly the animation clock ran; the view `ratings` gains the clock's columns."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

# Frozen as of this revision; {further} are the columns that are new.
VIEW = """
CREATE VIEW ratings AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS phase,
       r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status AS run_status,
       r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, {json} AS levels, c.cell AS cell, c.exemplar AS exemplar,
       c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256, t.response AS response,
       a.expected_response AS expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method,
       t.verdict AS verdict, t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms,
       t.frames_drawn AS frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing,
       t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost,
       t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm, r.excluded AS excluded,
       r.exclusion_reason AS exclusion_reason, {utc} AS saved_at, r.origin AS run_origin,
       v.number AS study_version, v.series AS data_series{further}
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
LEFT JOIN version_clips c ON c.id = a.version_clip_id
WHERE r.origin <> 'preview' AND r.erased_at IS NULL
"""
SPELLING = {
    "sqlite": {"utc": "replace(t.saved_at, ' ', 'T') || 'Z'", "json": "c.levels"},
    "postgresql": {
        "utc": """to_char(t.saved_at AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"')""",
        "json": "CAST(c.levels AS text)",
    },
}
FURTHER = ", t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms"
CHECK = "ck_trial_ratings_verdict_known"
BEFORE, AFTER = ("good", "flagged", "failed"), ("good", "uncertain", "flagged", "failed")


def upgrade() -> None:
    dialect = op.get_bind().dialect.name
    op.execute("DROP VIEW ratings")
    for column in ("clock_gap_ms", "clock_late_ms"):
        op.add_column("trial_ratings", sa.Column(column, sa.Double(), nullable=True))
    _allow(AFTER)
    op.execute(VIEW.format(**SPELLING[dialect], further=FURTHER))


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    op.execute("DROP VIEW ratings")
    # What was not known to be good is nearest to flagged; the rule beside it still says why.
    op.execute("UPDATE trial_ratings SET verdict = 'flagged' WHERE verdict = 'uncertain'")
    _allow(BEFORE)
    for column in ("clock_late_ms", "clock_gap_ms"):
        op.execute(f"ALTER TABLE trial_ratings DROP COLUMN {column}")
    op.execute(VIEW.format(**SPELLING[dialect], further=""))


def _allow(verdicts: tuple[str, ...]) -> None:
    """Let the column hold these words. No table refers to the ratings, so that SQLite may make theirs anew."""
    words = ", ".join(f"'{verdict}'" for verdict in verdicts)
    with op.batch_alter_table("trial_ratings") as table:
        table.drop_constraint(op.f(CHECK), type_="check")
        table.create_check_constraint(op.f(CHECK), sa.text(f"verdict IN ({words})"))
