"""Evidence of each answer; runs that began earlier are not judged."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "answer_evidence",
        sa.Column("study_run_id", sa.Integer(), nullable=False, autoincrement=False),
        sa.Column("trial_index", sa.Integer(), nullable=False, autoincrement=False),
        sa.Column("play", sa.Integer(), nullable=False, autoincrement=False),
        sa.Column("ticket", sa.String(length=40), nullable=False),
        sa.Column("issued_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("received_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("clip_ms", sa.Double(), nullable=False),
        sa.Column("digest", sa.String(length=64), nullable=True),
        sa.Column("digest_right", sa.Boolean(), nullable=True),
        sa.Column("late", sa.Boolean(), nullable=False),
        sa.Column("interaction", sa.JSON(none_as_null=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["study_run_id"],
            ["study_runs.id"],
            name=op.f("fk_answer_evidence_study_run_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", "play", name=op.f("pk_answer_evidence")),
    )
    op.execute(
        "ALTER TABLE study_runs ADD COLUMN evidence VARCHAR(5) DEFAULT 'none' NOT NULL "
        "CONSTRAINT ck_study_runs_evidence_known CHECK (evidence IN ('none', 'older', 'asked'))"
    )
    op.execute("ALTER TABLE study_runs ADD COLUMN evidence_verdict VARCHAR(10)")


def downgrade() -> None:
    stored = op.get_bind().scalar(sa.text("SELECT count(*) FROM answer_evidence"))
    if stored:
        raise RuntimeError(
            f"revision 0006 has no place for the evidence of {stored} answers; keep this revision, or take a "
            "backup and delete the rows of the table answer_evidence first"
        )
    op.execute("ALTER TABLE study_runs DROP COLUMN evidence_verdict")
    op.execute("ALTER TABLE study_runs DROP COLUMN evidence")
    op.drop_table("answer_evidence")
