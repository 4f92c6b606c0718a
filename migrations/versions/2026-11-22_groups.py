"""The group of each run, and the group that a link leads to."""

import json
from itertools import product
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None

TABLES = ("study_runs", "links")
VERSIONS = sa.text("SELECT id, definition FROM study_versions")
NAME = sa.text("UPDATE study_runs SET group_name = :name WHERE version_id = :version AND slot % :every = :turn")


def upgrade() -> None:
    for table in TABLES:
        op.execute(f"ALTER TABLE {table} ADD COLUMN group_name TEXT DEFAULT '' NOT NULL")
    connection = op.get_bind()
    for version, definition in connection.execute(VERSIONS).all():
        names = _groups(json.loads(definition) if isinstance(definition, str) else definition)
        for turn, name in enumerate(names if len(names) > 1 else ()):
            connection.execute(NAME, {"name": name, "version": version, "every": len(names), "turn": turn})


def downgrade() -> None:
    by_link = op.get_bind().scalar(sa.text("SELECT count(*) FROM links WHERE group_name <> ''"))
    if by_link:
        raise RuntimeError(
            f"revision 0011 has no place for the groups of {by_link} links; keep this revision, or take a backup "
            "and delete those links first"
        )
    for table in TABLES:
        op.execute(f"ALTER TABLE {table} DROP COLUMN group_name")


def _groups(definition: dict[str, Any]) -> list[str]:
    """The groups as of this revision took turns: levels of the factors between, last factor fastest."""
    between = (factor for factor in definition["factors"] if factor.get("between"))
    return ["/".join(levels) for levels in product(*([level["name"] for level in f["levels"]] for f in between))]
