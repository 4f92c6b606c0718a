"""`stimuli --help` lists every command without importing any."""

import subprocess
import sys
from importlib import import_module

import pytest
import typer

from stimuli_builder.cli import COMMANDS

HEAVY = ("numpy", "scipy", "pandas", "av", "cv2", "matplotlib", "numba", "skia", "pydantic")
LIST = f"""
import sys
from stimuli_builder.cli import main
sys.argv = ["stimuli", "--help"]
try:
    main()
finally:
    sys.stderr.write(" ".join(name for name in {HEAVY} if name in sys.modules))
"""


def test_help_lists_every_command_and_imports_none_of_their_libraries():
    ended = subprocess.run([sys.executable, "-c", LIST], capture_output=True, text=True, check=True)
    assert ended.stderr == ""
    section = ended.stdout.split("Commands:\n")[1]
    listed = [line.split(maxsplit=1)[0] for line in section.splitlines() if line[2:3].strip()]
    assert listed == list(COMMANDS)
    assert "..." not in section  # every line whole


@pytest.mark.parametrize("module", sorted({module for module, _ in COMMANDS.values()}))
def test_every_line_of_help_is_the_one_of_the_command_itself(module):
    part = typer.Typer()
    import_module(module).register(part)
    loaded = typer.main.get_group(part).commands
    lines = {
        name: " ".join(command.help.strip().split("\n\n")[0].split()) for name, command in loaded.items()
    }
    assert lines == {name: line for name, (home, line) in COMMANDS.items() if home == module}


def test_an_unknown_command_is_reported_with_the_nearest_one(monkeypatch, capsys):
    from stimuli_builder.cli import main

    monkeypatch.setattr(sys, "argv", ["stimuli", "blink"])
    with pytest.raises(SystemExit):
        main()
    assert "blinks" in capsys.readouterr().err
