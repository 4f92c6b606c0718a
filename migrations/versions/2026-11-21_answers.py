"""The clips of a trial are rows, by role; an answer is the payload of its kind of trial."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

# Frozen as of this revision. {response}, {clips} and {kept} differ from revision 0005, which is restored going down.
VIEW = """
CREATE VIEW ratings AS
SELECT s.name AS study, v.experiment AS experiment, v.definition_sha256 AS definition_sha256, r.phase AS phase,
       r.origin = 'simulated' AS synthetic, r.public_id AS run, r.participant AS participant, r.status AS run_status,
       r.language AS language, a.trial_index AS trial_index, a.kind AS kind, a.block AS block,
       a.block_label AS block_label, t.play AS play, {json} AS levels, c.cell AS cell, c.exemplar AS exemplar,
       c.profile_id AS profile_id, c.file AS stimulus, c.clip_sha256 AS clip_sha256, {response} AS response,
       a.expected_response AS expected_response, t.rt AS rt, t.rt_from_first_frame AS rt_from_first_frame,
       t.time_elapsed AS time_elapsed, t.changes AS changes, t.comment AS comment, t.method AS method,
       t.verdict AS verdict, t.verdict_rule AS verdict_rule, t.key_to_first_frame_ms AS key_to_first_frame_ms,
       t.frames_drawn AS frames_drawn, t.frames_late AS frames_late, t.frames_missing AS frames_missing,
       t.longest_gap_ms AS longest_gap_ms, t.stalls AS stalls, t.focus_lost AS focus_lost,
       t.refresh_rate_hz AS refresh_rate_hz, t.device_pixel_ratio AS device_pixel_ratio, t.px_per_mm AS px_per_mm,
       t.viewing_distance_mm AS viewing_distance_mm, r.excluded AS excluded,
       r.exclusion_reason AS exclusion_reason, {utc} AS saved_at, r.origin AS run_origin,
       v.number AS study_version, v.series AS data_series, t.clock_gap_ms AS clock_gap_ms,
       t.clock_late_ms AS clock_late_ms
FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
JOIN study_runs r ON r.id = t.study_run_id
JOIN study_versions v ON v.id = r.version_id
JOIN studies s ON s.id = r.study_id
{clips}
WHERE {kept}r.origin <> 'preview' AND r.erased_at IS NULL
"""
SPELLING = {
    "sqlite": {"utc": "replace(t.saved_at, ' ', 'T') || 'Z'", "json": "c.levels"},
    "postgresql": {
        "utc": """to_char(t.saved_at AT TIME ZONE 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"')""",
        "json": "CAST(c.levels AS text)",
    },
}
RESPONSE = {
    "sqlite": "json_extract(t.payload, '$.response')",
    "postgresql": "CAST(t.payload ->> 'response' AS integer)",
}
AFTER = {
    "clips": "LEFT JOIN trial_clips shown_clip ON shown_clip.study_run_id = t.study_run_id "
    "AND shown_clip.trial_index = t.trial_index AND shown_clip.role = 'shown'\n"
    "LEFT JOIN version_clips c ON c.id = shown_clip.version_clip_id",
    "kept": "t.kind = 'clip_rating' AND ",
}
BEFORE = {"clips": "LEFT JOIN version_clips c ON c.id = a.version_clip_id", "kept": "", "response": "t.response"}
PAYLOAD = {"sqlite": "json_object('response', response)", "postgresql": "json_build_object('response', response)"}
OTHER_KINDS = {
    "sqlite": "SELECT count(*) FROM study_versions "
    "WHERE coalesce(json_extract(definition, '$.trial.kind'), 'clip_rating') <> 'clip_rating'",
    "postgresql": "SELECT count(*) FROM study_versions "
    "WHERE coalesce(definition -> 'trial' ->> 'kind', 'clip_rating') <> 'clip_rating'",
}


def upgrade() -> None:
    dialect = op.get_bind().dialect.name
    op.execute("DROP VIEW ratings")
    _make_trial_clips()
    op.execute(
        "INSERT INTO trial_clips (study_run_id, trial_index, role, position, version_clip_id) "
        "SELECT study_run_id, trial_index, 'shown', 0, version_clip_id FROM assigned_trials "
        "WHERE version_clip_id IS NOT NULL"
    )
    _drop_the_one_clip(dialect)
    # Columns are added as they are: a table made anew would take the rows that refer to it with it (SQLite).
    op.execute("ALTER TABLE trial_ratings ADD COLUMN kind VARCHAR(40) DEFAULT 'clip_rating' NOT NULL")
    op.execute("ALTER TABLE trial_ratings ADD COLUMN payload JSON DEFAULT '{}' NOT NULL")
    op.execute("ALTER TABLE trial_ratings ADD COLUMN playback JSON")
    op.execute(f"UPDATE trial_ratings SET payload = {PAYLOAD[dialect]}")
    op.execute("ALTER TABLE trial_ratings DROP COLUMN response")
    op.execute(VIEW.format(**SPELLING[dialect], **AFTER, response=RESPONSE[dialect]))


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    stored = op.get_bind().scalar(sa.text(OTHER_KINDS[dialect]))
    if stored:
        raise RuntimeError(
            f"revision 0005 knows trials of the kind clip_rating only, and {stored} stored versions of studies have "
            "another; keep this revision, or take a backup and delete those studies first"
        )
    op.execute("DROP VIEW ratings")
    op.execute("ALTER TABLE trial_ratings ADD COLUMN response INTEGER")
    op.execute(f"UPDATE trial_ratings SET response = {RESPONSE[dialect].replace('t.payload', 'payload')}")
    for column in ("playback", "payload", "kind"):
        op.execute(f"ALTER TABLE trial_ratings DROP COLUMN {column}")
    op.execute(
        "ALTER TABLE assigned_trials ADD COLUMN version_clip_id INTEGER "
        "CONSTRAINT fk_assigned_trials_version_clip_id REFERENCES version_clips (id)"
    )
    op.execute(
        "UPDATE assigned_trials SET version_clip_id = (SELECT c.version_clip_id FROM trial_clips c "
        "WHERE c.study_run_id = assigned_trials.study_run_id AND c.trial_index = assigned_trials.trial_index)"
    )
    op.drop_table("trial_clips")
    op.execute(VIEW.format(**SPELLING[dialect], **BEFORE))


def _make_trial_clips() -> None:
    op.create_table(
        "trial_clips",
        sa.Column("study_run_id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("trial_index", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("role", sa.String(length=10), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("version_clip_id", sa.Integer(), nullable=False),
        sa.CheckConstraint(
            "role IN ('shown', 'left', 'right', 'first', 'second', 'reference')",
            name=op.f("ck_trial_clips_role_known"),
        ),
        sa.ForeignKeyConstraint(
            ["study_run_id", "trial_index"],
            ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
            name=op.f("fk_trial_clips_study_run_id_trial_index"),
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["version_clip_id"], ["version_clips.id"], name=op.f("fk_trial_clips_version_clip_id")
        ),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", "role", name=op.f("pk_trial_clips")),
        sqlite_with_rowid=False,
    )


def _drop_the_one_clip(dialect: str) -> None:
    """Drop assigned_trials.version_clip_id, which SQLite refuses while a foreign key of the table names it.

    Making the table anew would cascade to every answer. The constraint is taken out of the table's text instead,
    as SQLite's documentation of ALTER TABLE describes it for changes that leave the rows as they are.
    """
    if dialect == "sqlite":
        bind = op.get_bind()
        text = bind.scalar(sa.text("SELECT sql FROM sqlite_schema WHERE name = 'assigned_trials'"))
        clause = (
            r"(?:,\s*)?CONSTRAINT fk_assigned_trials_version_clip_id\s*(?:FOREIGN KEY\s*\(version_clip_id\)\s*)?"
            r"REFERENCES version_clips\s*\(id\)"
        )
        without, times = re.subn(clause, " ", text)
        if times != 1:
            raise RuntimeError("the table assigned_trials is not as revision 0005 made it; nothing was changed")
        bind.execute(sa.text("PRAGMA writable_schema = ON"))
        bind.execute(
            sa.text("UPDATE sqlite_schema SET sql = :sql WHERE name = 'assigned_trials'"), {"sql": without}
        )
        bind.execute(sa.text("PRAGMA writable_schema = RESET"))
    op.execute("ALTER TABLE assigned_trials DROP COLUMN version_clip_id")
