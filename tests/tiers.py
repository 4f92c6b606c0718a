"""Which tests `make test` leaves to `make test-all`: the one place where that is decided.

`make test` runs whatever is not `long`. `long` are the folders, files and tests of `LONG`, each with what it
waits for, every test in Firefox, and PostgreSQL outside `POSTGRES`. `tests/conftest.py` marks them; nobody
writes the marker itself at a test.
"""

from collections.abc import Collection

SHORT_RUN = "not long"
"""What `make test` gives pytest with `-m`."""

LONG = {
    "tests/experiments_e2e/": "hundreds of simulated people go through whole experiments",
    "tests/server/attacks/": "real servers under load from outside",
    "tests/analysis/report/test_r_script.py": "R",
    "tests/analysis/report/test_r_models.py": "R",
    "tests/analysis/report/test_r_choices.py": "R",
    "tests/server/export/test_scripts.py": "R",
    "tests/server/export/test_scripts_of_ratings.py": "R",
    "tests/server/test_durability.py": "kill -9 of real servers",
    "tests/server/test_killed_migrations.py": "kill -9 in the middle of migrations",
    "tests/server/test_two_hosts.py": "two hosts on one PostgreSQL",
    "tests/server/operations/test_openapi.py": "generated requests to every endpoint",
    "tests/deploy/test_point_in_time.py": "a PostgreSQL with an archive goes back to a moment",
    "tests/deploy/test_restore_script.py": "a PostgreSQL deployment is restored",
}
"""Path of a folder (it ends in a slash), of a file or of a test (`file::test`): why it is long."""

POSTGRES = (
    "tests/server/test_database_away.py",
    "tests/server/test_database_locks.py",
    "tests/server/test_group_commit.py",
    "tests/server/test_migrations.py",
    "tests/server/test_prepared.py",
    "tests/server/operations/test_pool.py",
    "tests/server/participants/test_run_starts.py",
    "tests/server/providers/test_sign_ins_at_once.py",
    "tests/server/runs/test_erase_lock.py",
    "tests/server/views/test_views.py",
    "tests/server/workspaces/test_row_security.py",
)
"""Files that `make test` runs on PostgreSQL too: its queries, views, locks and migrations."""


def is_long(name: str, markers: Collection[str]) -> bool:
    """Whether `make test` leaves a test (`file::test`) with these markers to `make test-all`."""
    on_postgres = "postgres" in markers and name.split("::")[0] not in POSTGRES
    return on_postgres or "firefox" in markers or entry_of(name) is not None


def entry_of(name: str) -> str | None:
    """The entry of `LONG` that names a test or a file: itself, its file or a folder."""
    names = (name, name.split("::")[0])
    return next((entry for entry in LONG if entry in names or is_below(entry, name)), None)


def is_below(entry: str, name: str) -> bool:
    """Whether an entry is a folder that holds this file."""
    return entry.endswith("/") and name.startswith(entry)
