"""How late and how surely a picture's time holds: only views changed, which the code makes (`experiments.kinds.views`)."""

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    pass
