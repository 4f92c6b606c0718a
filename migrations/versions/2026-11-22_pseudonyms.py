"""Participants by pseudonym; recruiters' ids in a table of their own."""

import hashlib
import hmac
import secrets
from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None

# Frozen as of this revision.
ID_PARAMETERS = {
    "prolific": "PROLIFIC_PID",
    "sona": "survey_code",
    "mturk": "workerId",
    "generic": "participant",
}
_json = sa.JSON(none_as_null=True)
studies = sa.table(
    "studies",
    sa.column("id", sa.Integer()),
    sa.column("recruiter", _json),
    sa.column("pseudonym_key", sa.String()),
)
links = sa.table(
    "links",
    sa.column("id", sa.Integer()),
    sa.column("public_id", sa.String()),
    sa.column("kind", sa.String()),
    sa.column("label", sa.String()),
    sa.column("recruiter", _json),
)
runs = sa.table(
    "study_runs",
    sa.column("id", sa.Integer()),
    sa.column("public_id", sa.String()),
    sa.column("study_id", sa.Integer()),
    sa.column("link_id", sa.Integer()),
    sa.column("token_hash", sa.String()),
    sa.column("participant", sa.String()),
    sa.column("recruiter_parameters", _json),
    sa.column("erased_at", sa.DateTime()),
)
identities = sa.table(
    "recruiter_identities",
    sa.column("study_run_id", sa.Integer()),
    sa.column("identifier", sa.String()),
    sa.column("parameters", _json),
)


def upgrade() -> None:
    op.create_table(
        "recruiter_identities",
        sa.Column("study_run_id", sa.Integer(), nullable=False, autoincrement=False),
        sa.Column("identifier", sa.String(length=500), nullable=False),
        sa.Column("parameters", _json, nullable=False),
        sa.ForeignKeyConstraint(
            ["study_run_id"],
            ["study_runs.id"],
            name=op.f("fk_recruiter_identities_study_run_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("study_run_id", name=op.f("pk_recruiter_identities")),
    )
    op.execute("ALTER TABLE studies ADD COLUMN pseudonym_key VARCHAR(64) DEFAULT '' NOT NULL")
    connection = op.get_bind()
    for study in connection.execute(sa.select(studies.c.id, studies.c.recruiter)).all():
        key = _key(connection, study.id)
        connection.execute(
            studies.update().where(studies.c.id == study.id).values(pseudonym_key=key)
        )
        _name_runs(connection, study, key)
    op.execute("ALTER TABLE study_runs DROP COLUMN recruiter_parameters")


def _key(connection: sa.Connection, study: int) -> str:
    """The key of a study's pseudonyms.

    Made from the hash of the secret token of its first run, so that a copy of the database that is migrated
    on its own, as from a backup, gets the same names.
    """
    query = sa.select(runs.c.token_hash).where(runs.c.study_id == study).order_by(runs.c.id).limit(1)
    secret = connection.scalar(query) or secrets.token_hex(32)
    return hashlib.sha256(f"pseudonyms of study {study}: {secret}".encode()).hexdigest()


def _name_runs(connection: sa.Connection, study: Any, key: str) -> None:
    of_links = {link.id: link for link in connection.execute(sa.select(links))}
    rows = connection.execute(sa.select(runs).where(runs.c.study_id == study.id)).all()
    for run in rows:
        link = of_links[run.link_id]
        parameters = run.recruiter_parameters or {}
        identifier = _identifier(study, link, parameters)
        if parameters:
            values = {"study_run_id": run.id, "identifier": identifier, "parameters": parameters}
            connection.execute(identities.insert(), values)
        known_as = f"link:{link.public_id}" if link.kind == "personal" else f"recruiter:{identifier}"
        if run.erased_at is None and (link.kind == "personal" or identifier):
            name = _pseudonym(key, known_as)
            connection.execute(runs.update().where(runs.c.id == run.id).values(participant=name))


def _identifier(study: Any, link: Any, parameters: Mapping[str, str]) -> str:
    recruiter = link.recruiter or study.recruiter or {}
    named = recruiter.get("id_parameter") or ID_PARAMETERS[recruiter.get("kind", "generic")]
    return parameters.get(named) or ""


def _pseudonym(key: str, known_as: str) -> str:
    digest = hmac.digest(bytes.fromhex(key), known_as.encode("utf-8", "surrogatepass"), hashlib.sha256)
    return f"p{digest.hex()[:12]}"


def downgrade() -> None:
    op.execute("ALTER TABLE study_runs ADD COLUMN recruiter_parameters JSON DEFAULT '{}' NOT NULL")
    connection = op.get_bind()
    of_links = {link.id: link for link in connection.execute(sa.select(links))}
    known = {row.study_run_id: row for row in connection.execute(sa.select(identities))}
    for run in connection.execute(sa.select(runs)).all():
        identity, link = known.get(run.id), of_links[run.link_id]
        own = link.label if link.kind == "personal" else identity.identifier if identity else ""
        values: dict[str, Any] = {"recruiter_parameters": identity.parameters if identity else {}}
        if run.erased_at is None:
            values["participant"] = (own or run.public_id)[:200]
        connection.execute(runs.update().where(runs.c.id == run.id).values(**values))
    op.execute("ALTER TABLE studies DROP COLUMN pseudonym_key")
    op.drop_table("recruiter_identities")
