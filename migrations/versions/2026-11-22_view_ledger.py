"""Views say how they ended and what disturbed them, and belong to a play; the tables of answers tell of them."""

from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None

# Columns are added as they are: a table made anew would take the rows that refer to it with it (SQLite).
ADDED = (
    "views ADD COLUMN play INTEGER DEFAULT 1 NOT NULL",
    "views ADD COLUMN outcome VARCHAR(12) CONSTRAINT ck_views_outcome_known "
    "CHECK (outcome IN ('shown', 'interrupted'))",
    "views ADD COLUMN showings JSON",
    "views ADD COLUMN disturbances JSON DEFAULT '{}' NOT NULL",
    "trial_ratings ADD COLUMN disturbances JSON",
)
DROPPED = (
    "trial_ratings DROP COLUMN disturbances",
    "views DROP COLUMN disturbances",
    "views DROP COLUMN showings",
    "views DROP COLUMN outcome",
    "views DROP COLUMN play",
)


def upgrade() -> None:
    for change in ADDED:
        op.execute(f"ALTER TABLE {change}")
    # A view from before was a play of its own.
    op.execute("UPDATE views SET play = number")


def downgrade() -> None:
    for change in DROPPED:
        op.execute(f"ALTER TABLE {change}")
