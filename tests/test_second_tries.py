"""What a second try of a failed test finds, and which ports two processes of tests are given."""

import os
import subprocess
import sys
from pathlib import Path

from tests.conftest import REPOSITORY
from tests.helpers.ports import APART, FIRST, LAST

SHARING = """
import pytest

@pytest.fixture(scope="session")
def process_wide():
    made = []
    yield made
    made.append("ended")

@pytest.fixture(scope="module")
def file_wide(process_wide):
    made = []
    yield made
    made.append("ended")

TRIES = []

def test_makes_a_name_once(process_wide, file_wide):
    for made in (process_wide, file_wide):
        assert "ada" not in made, "left by the first try"
        made.append("ada")
    TRIES.append((process_wide, file_wide))
    assert len(TRIES) == 2, "the first try fails"
    assert TRIES[0] == (["ada", "ended"], ["ada", "ended"]), "the first try's were taken down"
"""
DRAW = """
import itertools, sys
from tests.helpers import ports
ports._numbers = itertools.count(int(sys.argv[1]))
print(*[ports.free_port() for _ in range(20)], flush=True)
sys.stdin.read()
"""


def test_a_second_try_finds_nothing_of_the_first(tmp_path: Path) -> None:
    (tmp_path / "test_sharing.py").write_text(SHARING, encoding="utf-8")
    options = [
        "--reruns=1",
        "-p",
        "tests.conftest",
        "-c",
        os.devnull,
        "--rootdir",
        ".",
        "-raR",
        "-p",
        "no:cacheprovider",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "test_sharing.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY), "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed, 1 rerun" in done.stdout


def test_no_port_is_given_to_two_processes() -> None:
    begin = os.getpid() * APART % (LAST - FIRST)
    command = [sys.executable, "-c", DRAW, str(begin)]
    drawing = [
        subprocess.Popen(command, cwd=REPOSITORY, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    drawn = []
    for process in drawing:
        assert process.stdout is not None
        drawn.append(set(process.stdout.readline().split()))
    for process in drawing:
        process.communicate("", timeout=30)
    assert [len(ports) for ports in drawn] == [20, 20]
    assert drawn[0].isdisjoint(drawn[1])
