"""Recruiters' ids are encrypted under a key for each run, which a table of its own holds, wrapped."""

import base64
import hashlib
import hmac
import json
import os
from typing import Any

import sqlalchemy as sa
from alembic import context, op
from alembic.util import CommandError
from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.keywrap import InvalidUnwrap, aes_key_unwrap, aes_key_wrap

revision = "0025"
down_revision = "0024"
branch_labels = None
depends_on = None

BATCH = 500
_json = sa.JSON(none_as_null=True)
before = sa.table(
    "recruiter_identities", sa.column("study_run_id", sa.Integer()), sa.column("identifier", sa.String()), sa.column("parameters", _json)
)
after = sa.table(
    "recruiter_identities", sa.column("study_run_id", sa.Integer()), sa.column("identifier_hash", sa.String()), sa.column("sealed", sa.Text())
)
keys = sa.table("identity_keys", sa.column("study_run_id", sa.Integer()), sa.column("wrapped_key", sa.String()))
runs = sa.table(
    "study_runs",
    sa.column("id", sa.Integer()),
    sa.column("public_id", sa.String()),
    sa.column("study_id", sa.Integer()),
)
studies = sa.table("studies", sa.column("id", sa.Integer()), sa.column("pseudonym_key", sa.String()))


def upgrade() -> None:
    op.create_table(
        "identity_keys",
        sa.Column("study_run_id", sa.Integer(), nullable=False, autoincrement=False),
        sa.Column("wrapped_key", sa.String(length=80), nullable=False),
        sa.ForeignKeyConstraint(
            ["study_run_id"], ["study_runs.id"], name=op.f("fk_identity_keys_study_run_id"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("study_run_id", name=op.f("pk_identity_keys")),
    )
    connection = op.get_bind()
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("PRAGMA secure_delete = ON")  # what stood in the open is gone from the file
    people = connection.execute(
        sa.select(before.c.study_run_id, before.c.identifier, before.c.parameters, runs.c.public_id)
        .add_columns(studies.c.pseudonym_key)
        .join(runs, runs.c.id == before.c.study_run_id)
        .join(studies, studies.c.id == runs.c.study_id)
    ).all()
    op.drop_table("recruiter_identities")
    _make_table(sa.Column("identifier_hash", sa.String(length=64), nullable=False), sa.Column("sealed", sa.Text(), nullable=False))
    op.create_index(op.f("ix_recruiter_identities_identifier_hash"), "recruiter_identities", ["identifier_hash"])
    wrapping = _wrapping_key() if people else b""
    for start in range(0, len(people), BATCH):
        rows = [_sealed(wrapping, person) for person in people[start : start + BATCH]]
        connection.execute(after.insert(), [identity for identity, _ in rows])
        connection.execute(keys.insert(), [key for _, key in rows])


def _make_table(*columns: sa.Column[Any]) -> None:
    op.create_table(
        "recruiter_identities",
        sa.Column("study_run_id", sa.Integer(), nullable=False, autoincrement=False),
        *columns,
        sa.ForeignKeyConstraint(
            ["study_run_id"],
            ["study_runs.id"],
            name=op.f("fk_recruiter_identities_study_run_id"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("study_run_id", name=op.f("pk_recruiter_identities")),
    )


def _wrapping_key() -> bytes:
    secret: bytes = context.config.attributes["secret_key"]()
    return HKDF(algorithm=SHA256(), length=32, salt=None, info=b"palpebra identity keys").derive(secret)


def _sealed(wrapping: bytes, person: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The rows of both tables. Frozen as of this revision, as are all functions here."""
    key, nonce = AESGCM.generate_key(256), os.urandom(12)
    plain = json.dumps({"identifier": person.identifier, "parameters": person.parameters or {}})
    content = nonce + AESGCM(key).encrypt(nonce, plain.encode(), person.public_id.encode())
    identity = {
        "study_run_id": person.study_run_id,
        "identifier_hash": _hash(person.pseudonym_key, person.identifier),
        "sealed": base64.b64encode(content).decode(),
    }
    wrapped = base64.b64encode(aes_key_wrap(wrapping, key)).decode()
    return identity, {"study_run_id": person.study_run_id, "wrapped_key": wrapped}


def _hash(study_key: str, identifier: str) -> str:
    if not identifier:
        return ""
    known_as = f"duplicates:{identifier}".encode("utf-8", "surrogatepass")
    return hmac.digest(bytes.fromhex(study_key), known_as, hashlib.sha256).hex()


def downgrade() -> None:
    connection = op.get_bind()
    people = connection.execute(
        sa.select(after.c.study_run_id, after.c.sealed, keys.c.wrapped_key, runs.c.public_id)
        .outerjoin(keys, keys.c.study_run_id == after.c.study_run_id)
        .join(runs, runs.c.id == after.c.study_run_id)
        .where(after.c.sealed != "")
    ).all()
    wrapping = _wrapping_key() if people else b""
    opened = [row for row in (_opened(wrapping, person) for person in people) if row is not None]
    if len(opened) < len(people):
        raise CommandError(
            f"{len(people) - len(opened)} recruiters' IDs do not open with this secret key and would be lost; "
            "run: server database rewrap OLD_KEY_FILE"
        )
    op.drop_table("recruiter_identities")
    op.drop_table("identity_keys")
    _make_table(
        sa.Column("identifier", sa.String(length=500), nullable=False),
        sa.Column("parameters", _json, nullable=False),
    )
    for start in range(0, len(opened), BATCH):
        connection.execute(before.insert(), opened[start : start + BATCH])


def _opened(wrapping: bytes, person: Any) -> dict[str, Any] | None:
    """The row as it was; None where the secret key was changed since and nobody can read it."""
    try:
        key = aes_key_unwrap(wrapping, base64.b64decode(person.wrapped_key or ""))
        content = base64.b64decode(person.sealed)
        plain = json.loads(AESGCM(key).decrypt(content[:12], content[12:], person.public_id.encode()))
    except (InvalidUnwrap, InvalidTag, ValueError):
        return None
    return {"study_run_id": person.study_run_id, **plain}
