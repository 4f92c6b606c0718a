"""A command imports what it needs and no more: help needs no numerics, and baking no compiler."""

import json
import subprocess
import sys

import pytest

from stimuli_builder.cli import COMMANDS

PROBE = """
import json, sys
from stimuli_builder.cli import app
try:
    app(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
print("LOADED " + json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))
"""
CHARACTERS = {"bake", "character"}
"""They read the characters that are here, or the package that bakes them."""


def loaded(*arguments: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", PROBE, *arguments], capture_output=True, text=True, check=True
    )
    return set(json.loads(done.stdout.rpartition("LOADED ")[2]))


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - CHARACTERS))
def test_help_needs_no_numerics(command: str) -> None:
    assert not loaded(command, "--help") & {"numpy", "pandas", "scipy", "cv2", "numba", "skia", "av"}


def test_help_of_baking_needs_no_compiler() -> None:
    assert not loaded("bake", "--help") & {"numba", "skia"}


def test_an_unknown_command_is_reported_with_the_nearest_one(monkeypatch, capsys):
    from stimuli_builder.cli import main

    monkeypatch.setattr(sys, "argv", ["stimuli", "blink"])
    with pytest.raises(SystemExit):
        main()
    assert "blinks" in capsys.readouterr().err
