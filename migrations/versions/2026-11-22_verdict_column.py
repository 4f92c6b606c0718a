"""The verdict on each run stands beside its answers: only views changed, which the code makes (`experiments.kinds.views`)."""

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    pass
