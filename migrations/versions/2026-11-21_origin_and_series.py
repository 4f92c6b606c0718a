"""Origin of every run, data series and format of every version."""

import json
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


# A run's origin is what it was at its start: the database itself refuses to change it.
KEPT = {
    "sqlite": (
        "CREATE TRIGGER study_runs_keep_origin BEFORE UPDATE OF origin ON study_runs "
        "WHEN NEW.origin <> OLD.origin BEGIN SELECT RAISE(ABORT, 'the origin of a run does not change'); END",
    ),
    "postgresql": (
        "CREATE FUNCTION keep_origin() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        "RAISE EXCEPTION 'the origin of a run does not change'; END $$",
        "CREATE TRIGGER study_runs_keep_origin BEFORE UPDATE OF origin ON study_runs FOR EACH ROW "
        "WHEN (NEW.origin <> OLD.origin) EXECUTE FUNCTION keep_origin()",
    ),
}
FREED = {
    "sqlite": ("DROP TRIGGER study_runs_keep_origin",),
    "postgresql": ("DROP TRIGGER study_runs_keep_origin ON study_runs", "DROP FUNCTION keep_origin()"),
}
MEASURED = ("factors", "exemplars", "trial", "render")
"""Parts of a definition of that time that change what is measured; texts within them are compared apart."""


def upgrade() -> None:
    dialect = op.get_bind().dialect.name
    # Columns are added as they are: a table made anew would take the rows that refer to it with it (SQLite).
    op.execute(
        "ALTER TABLE study_runs ADD COLUMN origin VARCHAR(12) DEFAULT 'participant' NOT NULL CONSTRAINT "
        "ck_study_runs_origin_known CHECK (origin IN ('participant', 'preview', 'pilot', 'simulated'))"
    )
    op.execute(
        "UPDATE study_runs SET origin = CASE WHEN preview THEN 'preview' WHEN synthetic THEN 'simulated' "
        "WHEN phase = 'pilot' THEN 'pilot' ELSE 'participant' END"
    )
    op.execute("ALTER TABLE study_runs DROP COLUMN synthetic")
    op.execute("ALTER TABLE study_runs DROP COLUMN preview")
    op.execute("ALTER TABLE study_versions ADD COLUMN format INTEGER DEFAULT 1 NOT NULL")
    op.execute("ALTER TABLE study_versions ADD COLUMN series INTEGER DEFAULT 1 NOT NULL")
    _name_series()
    for statement in KEPT[dialect]:
        op.execute(statement)


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    for statement in FREED[dialect]:
        op.execute(statement)
    no = "0" if dialect == "sqlite" else "false"
    for column, origin in (("synthetic", "simulated"), ("preview", "preview")):
        op.execute(f"ALTER TABLE study_runs ADD COLUMN {column} BOOLEAN DEFAULT {no} NOT NULL")
        op.execute(f"UPDATE study_runs SET {column} = (origin = '{origin}')")
    op.execute("ALTER TABLE study_runs DROP COLUMN origin")
    op.execute("ALTER TABLE study_versions DROP COLUMN series")
    op.execute("ALTER TABLE study_versions DROP COLUMN format")


def _name_series() -> None:
    """Number the series of every study's versions: those that measure the same have the same number."""
    bind = op.get_bind()
    versions = sa.table(
        "study_versions", *(sa.column(name) for name in ("id", "study_id", "number", "series")),
        sa.column("definition", sa.JSON()),
    )  # fmt: skip
    clips = sa.text(
        "SELECT cell, exemplar, clip_sha256 FROM version_clips WHERE version_id = :version ORDER BY 1, 2, 3"
    )
    query = sa.select(versions.c.id, versions.c.study_id, versions.c.definition)
    known: dict[int, list[tuple[int, dict[str, Any], list[Any]]]] = {}
    for version, study, definition in bind.execute(query.order_by(versions.c.study_id, versions.c.number)):
        shown = [tuple(row) for row in bind.execute(clips, {"version": version})]
        parts = {name: definition.get(name) for name in MEASURED}
        older = known.setdefault(study, [])
        series = next(
            (number for number, before, clip in reversed(older) if clip == shown and _alike(before, parts)),
            max((number for number, _, _ in older), default=0) + 1,
        )
        older.append((series, parts, shown))
        bind.execute(sa.update(versions).where(versions.c.id == version).values(series=series))


def _alike(one: Any, other: Any) -> bool:
    """Equal, a text's further languages and the labels of factors and levels aside."""
    if isinstance(one, dict) and isinstance(other, dict):
        if _is_translated(one) and _is_translated(other):
            return all(one[language] == other[language] for language in one.keys() & other.keys())
        names = (one.keys() | other.keys()) - {"label"}
        return all(_alike(one.get(name), other.get(name)) for name in names)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_alike, one, other))
    return json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def _is_translated(value: dict[str, Any]) -> bool:
    """Texts by language tag: `en`, `pt-BR`."""
    texts = bool(value) and all(isinstance(text, str) for text in value.values())
    return texts and all(len(tag) == 2 or tag[2:3] == "-" for tag in value)
