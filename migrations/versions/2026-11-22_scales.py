"""Several scales a clip: only the view `ratings` changed, which the code makes (`experiments.kinds.views`)."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None

# Answers that the older program could not show: several scales, a slider, an answer beside the scale.
STORED = {
    "sqlite": "SELECT count(*) FROM trial_ratings WHERE kind = 'clip_rating' AND (json_type(payload, '$.answers') "
    "IS NOT NULL OR json_type(payload, '$.not_applicable') IS NOT NULL OR json_type(payload, '$.response') = 'real')",
    "postgresql": "SELECT count(*) FROM trial_ratings WHERE kind = 'clip_rating' AND (payload -> 'answers' IS NOT NULL "
    "OR payload -> 'not_applicable' IS NOT NULL OR payload ->> 'response' LIKE '%.%')",
}
DECLARED = {
    "sqlite": "SELECT count(*) FROM study_versions WHERE json_array_length(definition, '$.trial.scales') > 0",
    "postgresql": "SELECT count(*) FROM study_versions "
    "WHERE json_array_length(coalesce(definition -> 'trial' -> 'scales', '[]')) > 0",
}


def upgrade() -> None:
    pass


def downgrade() -> None:
    dialect = op.get_bind().dialect.name
    answers = op.get_bind().scalar(sa.text(STORED[dialect]))
    versions = op.get_bind().scalar(sa.text(DECLARED[dialect]))
    if answers or versions:
        raise RuntimeError(
            f"revision {down_revision} knows one scale of whole numbers a study only, and {versions} stored versions of "
            f"studies with {answers} answers have more; keep this revision, or take a backup and delete those first"
        )
