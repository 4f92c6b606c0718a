"""What a start of `server` loads, and what it says of an unknown command."""

import subprocess
import sys


def test_a_start_loads_no_library_of_rare_work() -> None:
    """Migrations, edited definitions and sign-in by a provider: each takes a part of the time of a start."""
    rare = ("alembic", "tomlkit", "authlib")
    say = f"import sys, server.app, server.cli_run; print([n for n in {rare} if n in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", say], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "[]"


def test_a_command_that_is_not_there_is_reported_with_the_nearest_one() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "server", "studi", "list"], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, "study" in ended.stderr) == (2, True)
    assert "Traceback" not in ended.stderr
