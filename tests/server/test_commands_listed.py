"""`server --help` lists every command without importing what any of them needs."""

import subprocess
import sys

import pytest

from experiments.command_groups import commands_of
from server.cli import COMMANDS

HEAVY = (
    "sqlalchemy",
    "fastapi",
    "pydantic",
    "authlib",
    "httpx",
    "uvicorn",
    "alembic",
    "server.core.settings",
)
LIST = f"""
import sys
from server.cli import main
sys.argv = ["server", "--help"]
try:
    main()
finally:
    sys.stderr.write(" ".join(name for name in {HEAVY} if name in sys.modules))
"""


def test_help_lists_every_command_and_imports_none_of_their_libraries() -> None:
    ended = subprocess.run([sys.executable, "-c", LIST], capture_output=True, text=True, check=True)
    assert ended.stderr == ""
    section = ended.stdout.split("Commands:\n")[1]
    listed = [line.split(maxsplit=1)[0] for line in section.splitlines() if line[2:3].strip()]
    assert listed == list(COMMANDS)
    assert "..." not in section  # every line whole


def test_a_start_loads_no_library_of_rare_work() -> None:
    """Migrations, edited definitions and sign-in by a provider: each takes a part of the time of a start."""
    rare = ("alembic", "tomlkit", "authlib")
    say = f"import sys, server.app, server.cli_run; print([n for n in {rare} if n in sys.modules])"
    ended = subprocess.run([sys.executable, "-c", say], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "[]"


@pytest.mark.parametrize("module", sorted({module for module, _ in COMMANDS.values()}))
def test_every_line_of_help_is_the_one_of_the_command_itself(module: str) -> None:
    lines = {
        name: " ".join((command.help or "").strip().split("\n\n")[0].split())
        for name, command in commands_of(module).items()
    }
    assert lines == {name: line for name, (home, line) in COMMANDS.items() if home == module}


def test_a_command_that_is_not_there_is_reported_with_the_nearest_one() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "server", "studi", "list"], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, "study" in ended.stderr) == (2, True)
    assert "Traceback" not in ended.stderr
