"""Adaptive series: their trials, what was offered and what was answered."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

TABLES = ("series_answers", "series_offers", "series_trials")


def upgrade() -> None:
    _make_trials()
    _make_offers()
    _make_answers()


def _place(*more: sa.Column[int]) -> list[sa.Column[int]]:
    names = ("study_run_id", "trial_index")
    return [*(sa.Column(name, sa.Integer(), autoincrement=False, nullable=False) for name in names), *more]


def _of_trial(table: str) -> sa.ForeignKeyConstraint:
    return sa.ForeignKeyConstraint(
        ["study_run_id", "trial_index"],
        ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
        name=op.f(f"fk_{table}_study_run_id_trial_index"),
        ondelete="CASCADE",
    )


def _of_clip(table: str) -> sa.ForeignKeyConstraint:
    name = op.f(f"fk_{table}_version_clip_id")
    return sa.ForeignKeyConstraint(["version_clip_id"], ["version_clips.id"], name=name)


def _make_trials() -> None:
    op.create_table(
        "series_trials",
        *_place(),
        sa.Column("series", sa.String(length=40), nullable=True),
        sa.Column("position", sa.Integer(), nullable=True),
        sa.Column("role", sa.String(length=10), nullable=False),
        sa.Column("closed", sa.Boolean(), nullable=False),
        sa.CheckConstraint(
            "role IN ('shown', 'first', 'second')", name=op.f("ck_series_trials_role_known")
        ),
        _of_trial("series_trials"),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", name=op.f("pk_series_trials")),
    )


def _make_offers() -> None:
    op.create_table(
        "series_offers",
        *_place(sa.Column("known", sa.Integer(), autoincrement=False, nullable=False)),
        sa.Column("version_clip_id", sa.Integer(), nullable=False),
        _of_trial("series_offers"),
        _of_clip("series_offers"),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", "known", name=op.f("pk_series_offers")),
        sqlite_with_rowid=False,
    )


def _make_answers() -> None:
    op.create_table(
        "series_answers",
        *_place(sa.Column("play", sa.Integer(), autoincrement=False, nullable=False)),
        sa.Column("version_clip_id", sa.Integer(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("positive", sa.Boolean(), nullable=True),
        sa.Column("correct", sa.Boolean(), nullable=True),
        sa.Column("counts", sa.Boolean(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=True),
        sa.Column("known", sa.Integer(), nullable=False),
        sa.Column("ahead", sa.Integer(), nullable=False),
        sa.Column("threshold", sa.Double(), nullable=True),
        sa.Column("threshold_sd", sa.Double(), nullable=True),
        sa.Column("spread", sa.Double(), nullable=True),
        sa.Column("entropy", sa.Double(), nullable=True),
        _of_trial("series_answers"),
        _of_clip("series_answers"),
        sa.PrimaryKeyConstraint("study_run_id", "trial_index", "play", name=op.f("pk_series_answers")),
    )


def downgrade() -> None:
    bind = op.get_bind()
    stored = bind.scalar(sa.text("SELECT count(*) FROM series_trials"))
    if stored:
        raise RuntimeError(
            f"revision 0008 has no place for the {stored} trials of adaptive series that are stored; keep this "
            "revision, or take a backup and delete the runs of these studies first"
        )
    for table in TABLES:
        op.drop_table(table)
