"""Counts of each run say what its answers took of its time, filled from the evidence that is stored."""

import sqlalchemy as sa
from alembic import op

revision = "0027"
down_revision = "0026"
branch_labels = None
depends_on = None

NUMBERS, MOMENTS = ("clip_ms", "newest_clip_ms"), ("first_issued_at", "newest_issued_at", "last_received_at")
OF_RUN = "FROM answer_evidence e WHERE e.study_run_id = run_tallies.study_run_id"
ALL = f"""
UPDATE run_tallies SET
    clip_ms = (SELECT COALESCE(SUM(e.clip_ms), 0) {OF_RUN}),
    first_issued_at = (SELECT MIN(e.issued_at) {OF_RUN}),
    newest_issued_at = (SELECT MAX(e.issued_at) {OF_RUN}),
    last_received_at = (SELECT MAX(e.received_at) {OF_RUN})
"""
NEWEST = f"""
UPDATE run_tallies SET newest_clip_ms =
    (SELECT COALESCE(SUM(e.clip_ms), 0) {OF_RUN} AND e.issued_at = run_tallies.newest_issued_at)
"""


def upgrade() -> None:
    for name in NUMBERS:
        op.add_column("run_tallies", sa.Column(name, sa.Double(), nullable=False, server_default="0"))
    for name in MOMENTS:
        op.add_column("run_tallies", sa.Column(name, sa.DateTime(timezone=True), nullable=True))
    op.execute(ALL)
    op.execute(NEWEST)


def downgrade() -> None:
    for name in (*NUMBERS, *MOMENTS):
        op.drop_column("run_tallies", name)
