"""Through which recruiter each run began, and an index of the trials that are not main ones."""

import json

import sqlalchemy as sa
from alembic import op

revision = "0033"
down_revision = "0032"
branch_labels = None
depends_on = None

NOT_MAIN = sa.text("kind <> 'main'")


def upgrade() -> None:
    """Runs of links that have a recruiter for themselves keep it; of others it was not stored."""
    op.add_column("study_runs", sa.Column("recruiter", sa.String(10), nullable=True))
    op.create_index(
        "ix_assigned_trials_not_main",
        "assigned_trials",
        ["study_run_id", "kind", "trial_index"],
        sqlite_where=NOT_MAIN,
        postgresql_where=NOT_MAIN,
    )
    connection = op.get_bind()
    links = connection.execute(sa.text("SELECT id, recruiter FROM links WHERE recruiter IS NOT NULL"))
    for link, stored in links.all():
        declared = json.loads(stored) if isinstance(stored, str) else stored
        if declared and declared.get("kind"):
            connection.execute(
                sa.text(
                    "UPDATE study_runs SET recruiter = :kind WHERE link_id = :link AND EXISTS (SELECT 1 FROM "
                    "recruiter_identities i WHERE i.study_run_id = study_runs.id AND i.identifier_hash <> '')"
                ),
                {"kind": declared["kind"], "link": link},
            )


def downgrade() -> None:
    """Undo."""
    op.drop_index("ix_assigned_trials_not_main", "assigned_trials")
    op.drop_column("study_runs", "recruiter")
