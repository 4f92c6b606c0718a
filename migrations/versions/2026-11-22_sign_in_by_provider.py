"""Sessions say which provider signed them in; sign-ins under way carry the invitation that they are to use."""

import sqlalchemy as sa
from alembic import op

revision = "0030"
down_revision = "0029"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("admin_sessions", sa.Column("provider", sa.String(30), nullable=True))
    op.add_column("login_attempts", sa.Column("invitation_hash", sa.String(64), nullable=True))


def downgrade() -> None:
    op.drop_column("login_attempts", "invitation_hash")
    op.drop_column("admin_sessions", "provider")
