"""Limits that all processes of a server on PostgreSQL share; one process on SQLite keeps them in memory."""

import sqlalchemy as sa
from alembic import op

revision = "0031"
down_revision = "0030"
branch_labels = None
depends_on = None


def upgrade() -> None:
    is_postgres = op.get_bind().dialect.name == "postgresql"
    op.create_table(
        "shared_counts",
        sa.Column("key", sa.String(32), nullable=False),
        sa.Column("amount", sa.Double(), nullable=False),
        sa.Column("before", sa.Double(), nullable=False),
        sa.Column("at", sa.DateTime(timezone=is_postgres), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_shared_counts"),
        # Not in the write-ahead log: a count costs no wait for the disk, and a crash may forget them all.
        prefixes=["UNLOGGED"] if is_postgres else [],
    )
    op.create_index("ix_shared_counts_at", "shared_counts", ["at"])


def downgrade() -> None:
    op.drop_index("ix_shared_counts_at", "shared_counts")
    op.drop_table("shared_counts")
