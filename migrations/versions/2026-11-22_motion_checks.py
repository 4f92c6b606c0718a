"""Motion checks: trials of the kind `check`."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None

BEFORE, AFTER = ("practice", "main", "attention"), ("practice", "main", "attention", "check")
ANSWERED = """
SELECT 1 FROM trial_ratings t
JOIN assigned_trials a ON a.study_run_id = t.study_run_id AND a.trial_index = t.trial_index
WHERE a.kind = 'check' LIMIT 1
"""
CHECK = "ck_assigned_trials_kind_known"


def upgrade() -> None:
    _allow(AFTER)


def downgrade() -> None:
    if op.get_bind().execute(sa.text(ANSWERED)).scalar():
        raise RuntimeError(
            "Answers to motion checks are stored; export them, and delete their studies, before going back."
        )
    # An earlier program knows no motion checks, nor clips without a cell.
    gone = "SELECT 1 FROM assigned_trials a WHERE a.kind = 'check' AND a.study_run_id = {0}.study_run_id"
    for table in ("answer_evidence", "trial_ratings", "views", "trial_clips"):
        op.execute(f"DELETE FROM {table} WHERE EXISTS ({gone.format(table)} AND a.trial_index = {table}.trial_index)")
    op.execute("DELETE FROM assigned_trials WHERE kind = 'check'")
    op.execute("DELETE FROM version_clips WHERE cell = ''")
    _allow(BEFORE)


def _allow(kinds: tuple[str, ...]) -> None:
    """Let a trial be of these kinds.

    Making the table anew would cascade to every answer in SQLite. The constraint is changed in the table's text
    instead, as SQLite's documentation of ALTER TABLE describes it for changes that leave the rows as they are.
    """
    words = ", ".join(f"'{kind}'" for kind in kinds)
    bind = op.get_bind()
    if bind.dialect.name != "sqlite":
        op.drop_constraint(op.f(CHECK), "assigned_trials", type_="check")
        op.create_check_constraint(op.f(CHECK), "assigned_trials", sa.text(f"kind IN ({words})"))
        return
    text = bind.scalar(sa.text("SELECT sql FROM sqlite_schema WHERE name = 'assigned_trials'"))
    changed, times = re.subn(r"kind IN \('practice', 'main', 'attention'(?:, 'check')?\)", f"kind IN ({words})", text)
    if times != 1:
        raise RuntimeError("the table assigned_trials is not as the revision before made it; nothing was changed")
    bind.execute(sa.text("PRAGMA writable_schema = ON"))
    bind.execute(sa.text("UPDATE sqlite_schema SET sql = :sql WHERE name = 'assigned_trials'"), {"sql": changed})
    bind.execute(sa.text("PRAGMA writable_schema = RESET"))
