"""The audit log is chained by hashes; what it held before stays outside the chain."""

import sqlalchemy as sa
from alembic import op

revision = "0023"
down_revision = "0022"
branch_labels = None
depends_on = None

ADDED = {"position": sa.Integer(), "details_salt": sa.String(32)}
ADDED_HASHES = ("details_digest", "chain_hash")


def upgrade() -> None:
    for name, kind in ADDED.items():
        op.add_column("audit_entries", sa.Column(name, kind, nullable=True))
    for name in ADDED_HASHES:
        op.add_column("audit_entries", sa.Column(name, sa.String(64), nullable=True))
    op.create_index("ix_audit_entries_position", "audit_entries", ["position"], unique=True)


def downgrade() -> None:
    op.drop_index("ix_audit_entries_position", "audit_entries")
    for name in (*ADDED_HASHES, *reversed(ADDED)):
        op.drop_column("audit_entries", name)
