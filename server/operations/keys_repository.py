"""Keys of ids and pseudonyms, read from and written to a database that may be of an older revision."""

from collections.abc import Mapping

from sqlalchemy import Connection, text

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
    """Study -> what stands as the key of its pseudonyms."""
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
