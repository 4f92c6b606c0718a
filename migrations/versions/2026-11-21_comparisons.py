"""Paired comparisons: only a view was new, which the code makes (`experiments.kinds.views`)."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    pass


def downgrade() -> None:
    stored = op.get_bind().scalar(sa.text("SELECT count(*) FROM trial_ratings WHERE kind = 'paired_comparison'"))
    if stored:
        raise RuntimeError(
            f"revision {down_revision} does not know the {stored} comparisons that are stored; keep this revision, or "
            "take a backup and delete the runs of these studies first"
        )
