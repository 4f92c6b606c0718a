"""How well a calibration was measured: repeats and their spread, the ruler's answer, how the distance was had.

Revision ID: 0016
Revises: 0015
"""

from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None


def _one_of(column: str, *words: str) -> str:
    listed = ", ".join(f"'{word}'" for word in words)
    return f"CONSTRAINT ck_calibrations_{column}_known CHECK ({column} IN ({listed}))"


DOUBLE = "{double}"
"""Stands for the database's own name of the type."""
ADDED = {
    "occasion": "VARCHAR(14) DEFAULT 'first' NOT NULL "
    + _one_of("occasion", "first", "screen_changed", "zoom", "recheck"),
    "repeats": "INTEGER",
    "spread_percent": DOUBLE,
    "ruler_check": "VARCHAR(10) " + _one_of("ruler_check", "agrees", "no_ruler", "differs"),
    "distance_method": "VARCHAR(10) " + _one_of("distance_method", "blind_spot", "typed"),
    "distance_spread_mm": DOUBLE,
    "distance_typed_mm": DOUBLE,
    "recheck_percent": DOUBLE,
}


def upgrade() -> None:
    double = "DOUBLE PRECISION" if op.get_bind().dialect.name == "postgresql" else "DOUBLE"
    for name, what in ADDED.items():
        op.execute(f"ALTER TABLE calibrations ADD COLUMN {name} {what.replace(DOUBLE, double)}")


def downgrade() -> None:
    for name in reversed(ADDED):
        op.execute(f"ALTER TABLE calibrations DROP COLUMN {name}")
