"""The verdict on a run beside its traces, as it stands beside answers of every other kind."""

import re

import sqlalchemy as sa
from alembic import op

revision = "0021"
down_revision = "0020"
branch_labels = None
depends_on = None

COLUMN = "coalesce(r.evidence_verdict, 'not_judged') AS evidence_verdict"


def upgrade() -> None:
    """Add the column at the end of the view, as the view stands."""
    selected, rows = _parts()
    _make(f"{selected},\n       {COLUMN}\n{rows}")


def downgrade() -> None:
    """Take it away again."""
    selected, rows = _parts()
    # PostgreSQL writes the column in words of its own.
    kept = re.sub(r",\s*COALESCE\(r\.evidence_verdict.*?AS evidence_verdict\s*$", "", selected, flags=re.I | re.S)
    _make(f"{kept}\n{rows}")


def _parts() -> tuple[str, str]:
    """What the view selects, and from where: its own FROM stands at the beginning of a line, those within deeper."""
    connection = op.get_bind()
    if connection.dialect.name == "sqlite":
        query = sa.text("SELECT sql FROM sqlite_master WHERE type = 'view' AND name = 'traces'")
        written = str(connection.scalar(query)).split(" AS", 1)[1]
    else:
        written = str(connection.scalar(sa.text("SELECT pg_get_viewdef(CAST('traces' AS regclass), true)")))
    selected, start, rows = re.split(r"\n( {0,3}FROM )", written.rstrip().rstrip(";"), maxsplit=1)
    return selected, f"{start}{rows}"


def _make(query: str) -> None:
    op.execute(sa.text("DROP VIEW traces"))
    op.execute(sa.text(f"CREATE VIEW traces AS{query}".replace(":", r"\:")))
