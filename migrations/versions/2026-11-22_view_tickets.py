"""Views carry tickets: when theirs was issued, how long their clips last; runs say whether their page brings them."""

import sqlalchemy as sa
from alembic import op

revision = "0024"
down_revision = "0023"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("views", sa.Column("issued_at", sa.DateTime(timezone=True), nullable=True))
    op.add_column("views", sa.Column("clip_ms", sa.Double(), nullable=True))
    op.add_column(
        "study_runs", sa.Column("view_tickets", sa.Boolean(), nullable=False, server_default=sa.false())
    )


def downgrade() -> None:
    op.drop_column("study_runs", "view_tickets")
    op.drop_column("views", "clip_ms")
    op.drop_column("views", "issued_at")
