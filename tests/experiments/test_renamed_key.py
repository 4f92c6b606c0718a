"""A key renamed in a declaration is noticed by the type checkers of both sides, shown on a copy."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FRONTEND = ROOT / "frontend"
PACKAGES = ("experiments", "server")
OLD, NEW = "fixation_ms", "fixation_length_ms"

pytestmark = [
    pytest.mark.skipif(
        not (FRONTEND / "node_modules").is_dir(), reason="npm packages are not here: run `make test`"
    ),
]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The packages of the contract, and the pages with their own packages linked."""
    for name in PACKAGES:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    left_out = shutil.ignore_patterns("node_modules", "dist")
    shutil.copytree(FRONTEND, tmp_path / "frontend", ignore=left_out)
    (tmp_path / "frontend" / "node_modules").symlink_to(FRONTEND / "node_modules")
    (tmp_path / ".venv").symlink_to(Path(sys.prefix))
    return tmp_path


def ran(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(folder if folder.name != "frontend" else folder.parent)}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def renamed(*files: Path) -> None:
    for file in files:
        file.write_text(re.sub(rf"\b{OLD}\b", NEW, file.read_text()))


def declaring(folder: Path) -> Path:
    """The module that declares the key."""
    declared = re.compile(rf"^    {OLD}: Annotated", re.MULTILINE)
    return next(path for path in (folder / "experiments").rglob("*.py") if declared.search(path.read_text()))


def test_the_key_renamed_in_its_declaration_breaks_mypy(copy: Path) -> None:
    renamed(declaring(copy))
    checked = ran(
        copy, sys.executable, "-m", "mypy", "--cache-dir", str(copy / ".cache"), "-p", "experiments"
    )
    assert checked.returncode == 1, checked.stderr
    assert OLD in checked.stdout


def test_the_key_renamed_in_the_whole_contract_breaks_the_pages(copy: Path) -> None:
    renamed(*(copy / "experiments").rglob("*.py"))
    made = ran(copy / "frontend", "npm", "run", "--silent", "api")
    assert made.returncode == 0, made.stderr
    checked = ran(copy / "frontend", "npm", "run", "--silent", "typecheck")
    assert checked.returncode != 0
    assert re.search(rf"src/participant/\S+: error TS\d+: Property '{OLD}' does not exist", checked.stdout)
