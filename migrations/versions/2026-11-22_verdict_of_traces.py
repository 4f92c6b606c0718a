"""The verdict on a run stands beside its traces: only a view changed, which the code makes (`experiments.kinds.views`)."""

revision = "0021"
down_revision = "0020"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    pass
