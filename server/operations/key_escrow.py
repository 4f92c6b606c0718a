"""What no backup holds: the keys of recruiters' IDs and of pseudonyms, in one separate file."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ValidationError
from sqlalchemy import Connection, text

from experiments.errors import InputError
from experiments.files import whole_private_file
from server.core.values import iso, new_pseudonym_key, now
from server.participation.identity_keys import UnreadableError, unwrap, wrap
from server.privacy.rows import Row

# Keys of ids and pseudonyms, read from and written to a database that may be of an older revision.

AT_ONCE = 500


def run_keys(connection: Connection) -> dict[str, str]:
    """Public id of a run -> its wrapped key."""
    rows = connection.execute(
        text(
            "SELECT r.public_id, k.wrapped_key FROM identity_keys k "
            "JOIN study_runs r ON r.id = k.study_run_id ORDER BY r.id"
        )
    )
    return {str(run): str(wrapped) for run, wrapped in rows}


def study_keys(connection: Connection) -> dict[int, str]:
    """Study -> the stored key of its pseudonyms."""
    rows = connection.execute(text("SELECT id, pseudonym_key FROM studies ORDER BY id"))
    return {int(study): str(key) for study, key in rows}


def set_study_key(connection: Connection, study: int, key: str) -> None:
    """Set the key of a study's pseudonyms."""
    statement = text("UPDATE studies SET pseudonym_key = :key WHERE id = :study")
    connection.execute(statement, {"key": key, "study": study})


def set_run_keys(connection: Connection, keys: Mapping[str, str]) -> tuple[int, int]:
    """Store the keys of the runs whose id is there, blank the ids of others; how many each."""
    rows = connection.execute(
        text(
            "SELECT i.study_run_id, r.public_id FROM recruiter_identities i "
            "JOIN study_runs r ON r.id = i.study_run_id WHERE i.sealed <> '' ORDER BY i.study_run_id"
        )
    ).all()
    known = [{"run": run, "key": keys[public]} for run, public in rows if public in keys]
    unknown = [{"run": run} for run, public in rows if public not in keys]
    store = text("INSERT INTO identity_keys (study_run_id, wrapped_key) VALUES (:run, :key)")
    blank = text("UPDATE recruiter_identities SET sealed = '' WHERE study_run_id = :run")
    for statement, values in ((store, known), (blank, unknown)):
        for start in range(0, len(values), AT_ONCE):
            connection.execute(statement, values[start : start + AT_ONCE])
    return len(known), len(unknown)


# What no backup holds: the keys of recruiters' IDs and of pseudonyms, in one file that each backup replaces.
#
# The next key file has no key of an erased person, so that what older backups hold of the id opens no more,
# wherever they are. The keys are wrapped (AES key wrap) under the secret key, which backups hold: neither
# file opens a recruiter's ID without the other, and a guessed id cannot be tried against the pseudonyms of a
# backup alone.

NAME = "palpebra-keys.json"
FORMAT = 1
APART = "identity_keys"
"""The table that backups leave out."""
STUDIES, STUDY_KEY = "studies", "pseudonym_key"


class KeyFile(BaseModel):
    """The file.

    Attributes
    ----------
    installation : str
        Fingerprint of the secret key.
    written_at : str
        The moment of its backup: a key file that is older than a backup lacks keys of that one.
    runs : dict of str to str
        Public id of a run to its wrapped key.
    studies : dict of str to str
        Fingerprint of a study's key, as the backup has it, to the wrapped key.
    """

    format: int = FORMAT
    installation: str
    written_at: str
    runs: dict[str, str]
    studies: dict[str, str]


def installation(secret: bytes) -> str:
    """Fingerprint of an installation's secret key."""
    return hashlib.sha256(b"palpebra installation " + secret).hexdigest()[:16]


def key_file_of(backup: Path) -> Path:
    """Where the key file of a backup is unless somebody put it elsewhere."""
    return backup.parent / NAME


def without_key(row: Row) -> Row:
    """A row of the studies as a backup has it: the fingerprint in place of the key."""
    return {**row, STUDY_KEY: _fingerprint(row[STUDY_KEY])} if row.get(STUDY_KEY) else row


def read_keys(connection: Connection, secret: bytes, moment: str) -> KeyFile:
    """The keys of the database at a moment (ISO 8601), which is that of the backup."""
    keys = study_keys(connection).values()
    return KeyFile(
        installation=installation(secret),
        written_at=moment,
        runs=run_keys(connection),
        studies={_fingerprint(key): wrap(secret, bytes.fromhex(key)) for key in keys if key},
    )


def check_replaceable(path: Path, secret: bytes) -> None:
    """Refuse to write over the keys of another installation."""
    if path.exists() and key_file(path).installation != installation(secret):
        raise InputError(
            f"{path} contains the keys of another installation or secret key. Back up to another folder, "
            f"choose another file with --keys, or move it to the backups of the previous secret key"
        )


# Decision 0744: A key file belongs to its backups.
def check_fits(keys: KeyFile, secret: bytes, backed_up_at: str, name: str, *, stale: bool) -> None:
    """Refuse keys of another installation than a backup's, and keys older than the backup.

    Parameters
    ----------
    secret : bytes
        As the backup has it.
    backed_up_at : str
        Moment of the backup.
    name : str
        Of the key file.
    stale : bool
        Take older ones, too.
    """
    if keys.installation != installation(secret):
        raise InputError(
            f"{name} belongs to another installation or secret key than the backup. Specify the key file "
            f"of the backup with --keys, or move the file away to restore without recruiters' IDs"
        )
    if keys.written_at < backed_up_at and not stale:
        raise InputError(
            f"{name} of {keys.written_at} is older than the backup of {backed_up_at}: IDs of later visits "
            f"would be lost. Make a new backup, specify a newer file with --keys, or restore with "
            f"--stale-keys"
        )


def write_keys(path: Path, keys: KeyFile) -> None:
    """Replace the key file unless a later backup wrote it; mode 600.

    A backup that another overtook would bring back the keys of people erased since.
    """
    if path.exists() and keys.written_at < key_file(path).written_at <= iso(now()):
        return
    with whole_private_file(path) as stream:
        stream.write(content_of_keys(keys))


def content_of_keys(keys: KeyFile) -> bytes:
    """The key file as it is written."""
    return json.dumps(keys.model_dump(), indent=1).encode()


def key_file(path: Path) -> KeyFile:
    """Read a key file; InputError where it is none."""
    try:
        return parse_key_file(path.read_bytes(), str(path))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error


def parse_key_file(content: bytes, name: str) -> KeyFile:
    """The key file of this content; InputError where it is none."""
    try:
        keys = KeyFile.model_validate_json(content)
    except ValidationError as error:
        raise InputError(
            f"{name}: expected a key file of `server backup` ({NAME}), got another file"
        ) from error
    if keys.format != FORMAT:
        raise InputError(
            f"{name} was written by a newer version (format {keys.format}); install that version"
        )
    return keys


def put_back(connection: Connection, secret: bytes, keys: KeyFile | None) -> tuple[int, int]:
    """Put the keys into a database that was restored; of how many ids there is a key, and of how many none.

    Ids without a key are blanked: nobody can read them. Studies without a key get a new one.
    """
    by_fingerprint = keys.studies if keys else {}
    for study, fingerprint in study_keys(connection).items():
        wrapped = by_fingerprint.get(fingerprint)
        key = _unwrap_key(secret, wrapped) if wrapped else None
        set_study_key(connection, study, key or new_pseudonym_key())
    return set_run_keys(connection, keys.runs if keys else {})


def _unwrap_key(secret: bytes, wrapped: str) -> str | None:
    try:
        return unwrap(secret, wrapped).hex()
    except UnreadableError:
        return None


def _fingerprint(study_key: str) -> str:
    return hashlib.sha256(f"pseudonym key {study_key}".encode()).hexdigest()
