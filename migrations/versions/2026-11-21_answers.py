"""The clips of a trial are rows, by role; an answer is the payload of its kind of trial."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

RESPONSE = {
    "sqlite": "json_extract(payload, '$.response')",
    "postgresql": "CAST(payload ->> 'response' AS integer)",
}
PAYLOAD = {"sqlite": "json_object('response', response)", "postgresql": "json_build_object('response', response)"}
OTHER_KINDS = {
    "sqlite": "SELECT count(*) FROM study_versions "
    "WHERE coalesce(json_extract(definition, '$.trial.kind'), 'clip_rating') <> 'clip_rating'",
    "postgresql": "SELECT count(*) FROM study_versions "
    "WHERE coalesce(definition -> 'trial' ->> 'kind', 'clip_rating') <> 'clip_rating'",
}


def upgrade() -> None:
    dialect = op.get_bind().dialect.name
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


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    stored = op.get_bind().scalar(sa.text(OTHER_KINDS[dialect]))
    if stored:
        raise RuntimeError(
            f"revision 0005 knows trials of the kind clip_rating only, and {stored} stored versions of studies have "
            "another; keep this revision, or take a backup and delete those studies first"
        )
    op.execute("ALTER TABLE trial_ratings ADD COLUMN response INTEGER")
    op.execute(f"UPDATE trial_ratings SET response = {RESPONSE[dialect]}")
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
