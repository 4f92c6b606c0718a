"""Workspaces: people belong to them with a role each, studies to one; grants on single studies.

Whoever has an account comes into the workspace `default` with the role she had, and so does every study:
nobody may do less or more than before.
"""

from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

revision = "0022"
down_revision = "0021"
branch_labels = None
depends_on = None

ROLES = "IN ('viewer', 'experimenter', 'owner')"
RIGHTS = "IN ('view', 'run', 'edit', 'export', 'own')"


def upgrade() -> None:
    time = sa.DateTime(timezone=op.get_bind().dialect.name == "postgresql")
    op.create_table(
        "workspaces",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(60), nullable=False),
        sa.Column("title", sa.String(200), nullable=False),
        sa.Column("second_factor_required", sa.Boolean(), nullable=False),
        sa.Column("created_at", time, nullable=False),
        sa.Column("created_by", sa.Integer(), nullable=True),
        sa.ForeignKeyConstraint(
            ["created_by"], ["accounts.id"], name="fk_workspaces_created_by", ondelete="SET NULL"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_workspaces"),
        sa.UniqueConstraint("name", name="uq_workspaces_name"),
    )
    op.create_table(
        "workspace_members",
        sa.Column("workspace_id", sa.Integer(), nullable=False),
        sa.Column("account_id", sa.Integer(), nullable=False),
        sa.Column("role", sa.String(20), nullable=False),
        sa.Column("added_at", time, nullable=False),
        sa.CheckConstraint(f"role {ROLES}", name="role_known"),
        sa.ForeignKeyConstraint(
            ["workspace_id"], ["workspaces.id"], name="fk_workspace_members_workspace_id", ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(
            ["account_id"], ["accounts.id"], name="fk_workspace_members_account_id", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("workspace_id", "account_id", name="pk_workspace_members"),
    )
    op.create_index("ix_workspace_members_account_id", "workspace_members", ["account_id"])
    op.create_table(
        "study_grants",
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("account_id", sa.Integer(), nullable=False),
        sa.Column("granted", sa.String(10), nullable=False),
        sa.Column("granted_at", time, nullable=False),
        sa.Column("granted_by", sa.Integer(), nullable=True),
        sa.CheckConstraint(f"granted {RIGHTS}", name="granted_known"),
        sa.ForeignKeyConstraint(
            ["study_id"], ["studies.id"], name="fk_study_grants_study_id", ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(
            ["account_id"], ["accounts.id"], name="fk_study_grants_account_id", ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(
            ["granted_by"], ["accounts.id"], name="fk_study_grants_granted_by", ondelete="SET NULL"
        ),
        sa.PrimaryKeyConstraint("study_id", "account_id", "granted", name="pk_study_grants"),
    )
    op.create_index("ix_study_grants_account_id", "study_grants", ["account_id"])
    # Added as they are: a table made anew would take the rows that refer to it with it (SQLite).
    for change in (
        "studies ADD COLUMN workspace_id INTEGER CONSTRAINT fk_studies_workspace_id REFERENCES workspaces (id)",
        "invitations ADD COLUMN workspace_id INTEGER CONSTRAINT fk_invitations_workspace_id "
        "REFERENCES workspaces (id)",
        "invitations ADD COLUMN workspace_role VARCHAR(20)",
    ):
        op.execute(f"ALTER TABLE {change}")
    op.create_index("ix_studies_workspace_id", "studies", ["workspace_id"])
    _move_in()


def _move_in() -> None:
    """Put everybody and everything into `default`; an empty database stays empty."""
    connection = op.get_bind()
    everything = "SELECT (SELECT count(*) FROM accounts) + (SELECT count(*) FROM studies)"
    if not connection.scalar(sa.text(everything)):
        return
    at = {"at": datetime.now(UTC).replace(tzinfo=None if connection.dialect.name == "sqlite" else UTC)}
    times = [sa.bindparam("at", type_=sa.DateTime(timezone=connection.dialect.name == "postgresql"))]
    workspace = "INSERT INTO workspaces (name, title, second_factor_required, created_at)"
    connection.execute(
        sa.text(f"{workspace} VALUES ('default', 'Laboratory', false, :at)").bindparams(*times), at
    )
    members = "INSERT INTO workspace_members (workspace_id, account_id, role, added_at)"
    connection.execute(
        sa.text(f"{members} SELECT w.id, a.id, a.role, :at FROM workspaces w, accounts a").bindparams(*times), at
    )
    connection.execute(sa.text("UPDATE studies SET workspace_id = (SELECT id FROM workspaces)"))


def downgrade() -> None:
    _refuse_what_would_open()
    op.drop_index("ix_studies_workspace_id", "studies")
    if op.get_bind().dialect.name == "sqlite":
        # SQLite drops no column that refers to a table; it is let go of by leaving the reference out.
        _drop_references_of_sqlite()
    else:
        op.drop_column("studies", "workspace_id")
        op.drop_column("invitations", "workspace_id")
    op.drop_column("invitations", "workspace_role")
    for name in ("study_grants", "workspace_members", "workspaces"):
        op.drop_table(name)


def _drop_references_of_sqlite() -> None:
    for table in ("studies", "invitations"):
        op.execute(f"ALTER TABLE {table} DROP COLUMN workspace_id")


def _refuse_what_would_open() -> None:
    """Before there were workspaces everybody saw every study: go back only where that is so already."""
    connection = op.get_bind()
    further = connection.scalar(sa.text("SELECT count(*) FROM workspaces WHERE name <> 'default'"))
    outside = connection.scalar(
        sa.text(
            "SELECT count(*) FROM accounts a LEFT JOIN workspace_members m ON m.account_id = a.id "
            "AND m.workspace_id IN (SELECT id FROM workspaces WHERE name = 'default') "
            "WHERE m.role IS NULL OR m.role <> a.role"
        )
    )
    if further or outside:
        raise RuntimeError(
            f"the revision before knows one workspace, and {further} others and {outside} accounts with a role "
            "of their own in it would be opened to everybody; keep this revision, or remove them first"
        )
