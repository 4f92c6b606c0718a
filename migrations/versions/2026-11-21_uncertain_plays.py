"""Verdict `uncertain`, and how evenly the animation clock ran."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

CHECK = "ck_trial_ratings_verdict_known"
BEFORE, AFTER = ("good", "flagged", "failed"), ("good", "uncertain", "flagged", "failed")


def upgrade() -> None:
    for column in ("clock_gap_ms", "clock_late_ms"):
        op.add_column("trial_ratings", sa.Column(column, sa.Double(), nullable=True))
    _allow(AFTER)


def downgrade() -> None:
    # What was not known to be good is nearest to flagged; the rule beside it still says why.
    op.execute("UPDATE trial_ratings SET verdict = 'flagged' WHERE verdict = 'uncertain'")
    _allow(BEFORE)
    for column in ("clock_late_ms", "clock_gap_ms"):
        op.execute(f"ALTER TABLE trial_ratings DROP COLUMN {column}")


def _allow(verdicts: tuple[str, ...]) -> None:
    """Let the column hold these words. No table refers to the ratings, so that SQLite may make theirs anew."""
    words = ", ".join(f"'{verdict}'" for verdict in verdicts)
    with op.batch_alter_table("trial_ratings") as table:
        table.drop_constraint(op.f(CHECK), type_="check")
        table.create_check_constraint(op.f(CHECK), sa.text(f"verdict IN ({words})"))
