"""Every command of the tutorials runs as it is printed, in order, in an empty folder."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

TUTORIALS = sorted(
    file for file in (REPOSITORY / "docs" / "tutorials").glob("*.md") if file.name != "index.md"
)
BLOCK = re.compile(r"^```(sh|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r"`(\w+\.toml)`")


def steps_of(page: Path) -> list[tuple[str, str]]:
    """Commands to run and files to save, in the order of the page: (`$`, commands) or (file, text)."""
    text = page.read_text(encoding="utf-8")
    steps = []
    for block in BLOCK.finditer(text):
        language, content = block.groups()
        if language == "sh":
            steps.append(("$", content))
        else:
            steps.append((FILE_NAME.findall(text[: block.start()])[-1], content))
    return steps


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_commands_of_tutorial_run(page: Path, tmp_path: Path) -> None:
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": programs, "PALPEBRA_DATA_FOLDER": str(tmp_path / "data")}
    environment.pop("DATABASE_URL", None)
    ran = 0
    for what, content in steps_of(page):
        if what != "$":
            (tmp_path / what).write_text(content, encoding="utf-8")
            continue
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", content],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{content}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        ran += 1
    assert ran
    reports = {
        "own-clips": "report/report.html",
        "paper": "report-exp1/report.html",
        "blinks": "blinks.html",
        "pairs": "report-systems/report.html",
        "analyze-csv": "ratings.csv",
    }
    assert (tmp_path / reports[page.stem]).stat().st_size > 1000
