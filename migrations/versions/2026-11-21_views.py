"""Each view of a trial: begun when it starts, completed when it ends, with a compact log of its frames."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "views",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("view_id", sa.String(length=40), nullable=False),
        sa.Column("study_run_id", sa.Integer(), nullable=False),
        sa.Column("trial_index", sa.Integer(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("started_at_client", sa.DateTime(timezone=True), nullable=False),
        sa.Column("received_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("ended_at_client", sa.DateTime(timezone=True), nullable=True),
        sa.Column("completed", sa.Boolean(), nullable=False),
        sa.Column("screen", sa.JSON(none_as_null=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["study_run_id", "trial_index"],
            ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
            name=op.f("fk_views_study_run_id_trial_index"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_views")),
        sa.UniqueConstraint("study_run_id", "view_id", name=op.f("uq_views_study_run_id_view_id")),
        sa.UniqueConstraint(
            "study_run_id", "trial_index", "number", name=op.f("uq_views_study_run_id_trial_index_number")
        ),
    )
    op.create_table(
        "view_clips",
        sa.Column("view", sa.Integer(), nullable=False),
        sa.Column("role", sa.String(length=10), nullable=False),
        sa.Column("clip_sha256", sa.String(length=64), nullable=False),
        sa.Column("frame_log", sa.Text(), nullable=False),
        sa.CheckConstraint(
            "role IN ('shown', 'left', 'right', 'first', 'second', 'reference')",
            name=op.f("ck_view_clips_role_known"),
        ),
        sa.ForeignKeyConstraint(
            ["view"], ["views.id"], name=op.f("fk_view_clips_view"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("view", "role", name=op.f("pk_view_clips")),
    )


def downgrade() -> None:
    stored = op.get_bind().scalar(sa.text("SELECT count(*) FROM views"))
    if stored:
        raise RuntimeError(
            f"revision 0003 has no place for the {stored} views that are stored; keep this revision, or take a "
            "backup and delete the rows of the table views first"
        )
    op.drop_table("view_clips")
    op.drop_table("views")
