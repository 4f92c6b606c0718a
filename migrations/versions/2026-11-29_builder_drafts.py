"""Who has the builder of a study open, and the unsaved work of each tab."""

import sqlalchemy as sa
from alembic import op

revision = "0034"
down_revision = "0033"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """One row per study, account and tab."""
    op.create_table(
        "builder_drafts",
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("account_id", sa.Integer(), nullable=False),
        sa.Column("tab", sa.String(40), nullable=False),
        sa.Column("seen_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("draft", sa.JSON(), nullable=True),
        sa.Column("saved_at", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["study_id"], ["studies.id"], name="fk_builder_drafts_study_id", ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(
            ["account_id"], ["accounts.id"], name="fk_builder_drafts_account_id", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("study_id", "account_id", "tab", name="pk_builder_drafts"),
    )
    op.create_index("ix_builder_drafts_account_id", "builder_drafts", ["account_id"])


def downgrade() -> None:
    """Undo; unsaved work stays in the browsers that it was written in."""
    op.drop_table("builder_drafts")
