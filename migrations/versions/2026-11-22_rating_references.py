"""The reference before a rated clip: only a view changed, which the code makes (`experiments.kinds.views`)."""

revision = "0029"
down_revision = "0028"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    pass
