"""The verdict on each run stands beside its answers, so that a declared rule can leave runs out by it."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None

VIEWS = ("ratings", "comparisons", "thresholds")
COLUMN = "coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict"


def upgrade() -> None:
    """Add the column at the end of each view of answers, as the view stands."""
    for view in VIEWS:
        selected, rows = _parts(view)
        _make(view, f"{selected},\n       {COLUMN}\n{rows}")


def downgrade() -> None:
    """Take it away again."""
    for view in VIEWS:
        selected, rows = _parts(view)
        # PostgreSQL writes the column in words of its own.
        kept = re.sub(r",\s*COALESCE\(r\.evidence_verdict.*?AS evidence_verdict\s*$", "", selected, flags=re.I | re.S)
        _make(view, f"{kept}\n{rows}")


def _parts(view: str) -> tuple[str, str]:
    """What a view selects, and from where: its own FROM stands at the beginning of a line, those within deeper."""
    connection = op.get_bind()
    if connection.dialect.name == "sqlite":
        query = sa.text("SELECT sql FROM sqlite_master WHERE type = 'view' AND name = :view")
        written = str(connection.scalar(query, {"view": view})).split(" AS", 1)[1]
    else:
        written = str(connection.scalar(sa.text("SELECT pg_get_viewdef(CAST(:view AS regclass), true)"), {"view": view}))
    selected, start, rows = re.split(r"\n( {0,3}FROM )", written.rstrip().rstrip(";"), maxsplit=1)
    return selected, f"{start}{rows}"


def _make(view: str, query: str) -> None:
    op.execute(sa.text(f"DROP VIEW {view}"))
    op.execute(sa.text(f"CREATE VIEW {view} AS{query}".replace(":", r"\:")))
