"""A copy of the tree, in which something is added and commands are run."""

import os
import shutil
import subprocess
from pathlib import Path

from tests.conftest import REPOSITORY
from tests.experiments.additions.added import Edit

COPIED = (
    "experiments",
    "server",
    "table_files",
    "video_conversion",
    "analysis",
    "migrations",
    "tests",
    "tools",
    "bench",
    "docs",
    "blink_engine",
)
NOT_COPIED = ("node_modules", "dist", "__pycache__", "backups", "databases", "browser", "decisions", "*.png")


def copy_tree(folder: Path, *further: str) -> None:
    """Copy what the programs of Python need, and further folders, into this one."""
    left_out = shutil.ignore_patterns(*NOT_COPIED)
    for name in (*COPIED, *further):
        shutil.copytree(REPOSITORY / name, folder / name, ignore=left_out)
    for name in ("pyproject.toml", "alembic.ini"):
        shutil.copy(REPOSITORY / name, folder)


def add(folder: Path, addition: dict[str, str | Edit]) -> None:
    """Write the new files and make the edits."""
    for name, content in addition.items():
        path = folder / name
        assert path.exists() == isinstance(content, Edit), name
        if isinstance(content, Edit):
            text = path.read_text(encoding="utf-8")
            assert text.count(content.before) == 1, name
            content = text.replace(*content)
        path.parent.mkdir(exist_ok=True)
        path.write_text(content, encoding="utf-8")


def ran(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """A command in the copy, whose packages come before those that are installed."""
    root = folder.parent if folder.name == "frontend" else folder
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
