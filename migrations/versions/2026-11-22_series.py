"""Adaptive series: their trials, what was offered and what was answered, and the view of thresholds."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

TABLES = ("series_answers", "series_offers", "series_trials")

# Frozen as of this revision.
SQLITE = """
CREATE VIEW thresholds AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS
       phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status
       AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, q.series AS series, q.position AS position, w.value AS
       value, q.role AS interval, c.levels AS levels, c.cell AS cell, c.exemplar AS exemplar, c.profile_id AS
       profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256, json_extract(t.payload, '$.chosen') AS
       response, w.correct AS correct, a.expected_response AS expected_response, w.counts AS counts, w.known
       AS known, w.ahead AS ahead, w.threshold AS threshold, w.threshold_sd AS threshold_sd, w.spread AS
       spread, w.entropy AS entropy, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed
       AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method, t.verdict AS verdict,
       t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS
       frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS
       longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz,
       t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS
       viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS exclusion_reason,
       replace(t.saved_at, ' ', 'T') || 'Z' AS saved_at, r.origin AS run_origin, v.number AS study_version,
       v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS clock_late_ms
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
"""
POSTGRESQL = """
CREATE VIEW thresholds AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS
       phase, r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status
       AS run_status, r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, q.series AS series, q.position AS position, w.value AS
       value, q.role AS interval, CAST(c.levels AS text) AS levels, c.cell AS cell, c.exemplar AS exemplar,
       c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256, t.payload ->> 'chosen' AS
       response, w.correct AS correct, a.expected_response AS expected_response, w.counts AS counts, w.known
       AS known, w.ahead AS ahead, w.threshold AS threshold, w.threshold_sd AS threshold_sd, w.spread AS
       spread, w.entropy AS entropy, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame, t.time_elapsed
       AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method, t.verdict AS verdict,
       t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms, t.frames_drawn AS
       frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing, t.longest_gap_ms AS
       longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost, t.refresh_rate_hz AS refresh_rate_hz,
       t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm, t.viewing_distance_mm AS
       viewing_distance_mm, r.excluded AS excluded, r.exclusion_reason AS exclusion_reason, to_char(t.saved_at
       AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"') AS saved_at, r.origin AS run_origin, v.number AS
       study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms, t.clock_late_ms AS
       clock_late_ms
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
"""


def upgrade() -> None:
    _make_trials()
    _make_offers()
    _make_answers()
    op.execute(SQLITE if op.get_bind().dialect.name == "sqlite" else POSTGRESQL)


def _place(*more: sa.Column[int]) -> list[sa.Column[int]]:
    names = ("study_run_id", "trial_index")
    return [*(sa.Column(name, sa.Integer(), autoincrement=False, nullable=False) for name in names), *more]


def _of_trial(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["study_run_id", "trial_index"],
        ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
        name=op.f(f"fk_{table}_study_run_id_trial_index"),
        ondelete="CASCADE",
    )


def _of_clip(table: str) -> sa.ForeignKeyConstraint:
    name = op.f(f"fk_{table}_version_clip_id")
    return sa.ForeignKeyConstraint(["version_clip_id"], ["version_clips.id"], name=name)


def _make_trials() -> None:
    op.create_table(
        "series_trials",
        *_place(),
        sa.Column("series", sa.String(length=40), nullable=True),
        sa.Column("position", sa.Integer(), nullable=True),
        sa.Column("role", sa.String(length=10), nullable=False),
        sa.Column("closed", sa.Boolean(), nullable=False),
        sa.CheckConstraint(
            "role IN ('shown', 'first', 'second')", name=op.f("ck_series_trials_role_known")
        ),
        _of_trial("series_trials"),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", name=op.f("pk_series_trials")),
    )


def _make_offers() -> None:
    op.create_table(
        "series_offers",
        *_place(sa.Column("known", sa.Integer(), autoincrement=False, nullable=False)),
        sa.Column("version_clip_id", sa.Integer(), nullable=False),
        _of_trial("series_offers"),
        _of_clip("series_offers"),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", "known", name=op.f("pk_series_offers")),
        sqlite_with_rowid=False,
    )


def _make_answers() -> None:
    op.create_table(
        "series_answers",
        *_place(sa.Column("play", sa.Integer(), autoincrement=False, nullable=False)),
        sa.Column("version_clip_id", sa.Integer(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("positive", sa.Boolean(), nullable=True),
        sa.Column("correct", sa.Boolean(), nullable=True),
        sa.Column("counts", sa.Boolean(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=True),
        sa.Column("known", sa.Integer(), nullable=False),
        sa.Column("ahead", sa.Integer(), nullable=False),
        sa.Column("threshold", sa.Double(), nullable=True),
        sa.Column("threshold_sd", sa.Double(), nullable=True),
        sa.Column("spread", sa.Double(), nullable=True),
        sa.Column("entropy", sa.Double(), nullable=True),
        _of_trial("series_answers"),
        _of_clip("series_answers"),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", "play", name=op.f("pk_series_answers")),
    )


def downgrade() -> None:
    bind = op.get_bind()
    stored = bind.scalar(sa.text("SELECT count(*) FROM series_trials"))
    if stored:
        raise RuntimeError(
            f"revision 0008 has no place for the {stored} trials of adaptive series that are stored; keep this "
            "revision, or take a backup and delete the runs of these studies first"
        )
    op.execute("DROP VIEW thresholds")
    for table in TABLES:
        op.drop_table(table)
