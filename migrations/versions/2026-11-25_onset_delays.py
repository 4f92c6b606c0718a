"""Delays as measured from the press (decision 0835): only views changed, which the code makes (`experiments.kinds.views`)."""

revision = "0032"
down_revision = "0031"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    pass
