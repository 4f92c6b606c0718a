"""When a study was put into the archive."""

from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    kind = "TIMESTAMP WITH TIME ZONE" if op.get_bind().dialect.name == "postgresql" else "DATETIME"
    op.execute(f"ALTER TABLE studies ADD COLUMN archived_at {kind}")


def downgrade() -> None:
    op.execute("ALTER TABLE studies DROP COLUMN archived_at")
