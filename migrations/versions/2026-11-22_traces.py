"""Traces of continuous ratings: when the blinks of a performance's clip begin."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("version_clips", sa.Column("blinks_s", sa.JSON(none_as_null=True), nullable=True))


def downgrade() -> None:
    stored = "SELECT 1 FROM trial_ratings WHERE kind = 'continuous_rating' LIMIT 1"
    if op.get_bind().execute(sa.text(stored)).scalar():
        raise RuntimeError(
            "Continuous ratings are stored; export them, and delete their studies, before going back."
        )
    op.drop_column("version_clips", "blinks_s")
