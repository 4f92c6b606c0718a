"""`make house`: what it counts, on a small tree in which every number is known."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tools.house.__main__ import House
from tools.house.graphs import longest_chain

FILES = {
    "server/__init__.py": "",
    "server/app.py": "from server import rows\n\n\ndef start():\n    from server.late import Late\n",
    "server/rows.py": "import server.models\n",
    "server/models.py": "import server.words\nif typing.TYPE_CHECKING:\n    from .rows import Row\n",
    "server/late.py": "from experiments.trials.threshold import plan\n",
    "server/judge.py": 'def judge(kind):\n    return kind == "threshold"\n',
    "server/words.py": 'def name(what):\n    return what == "threshold"  # a word of statistics\n',
    "server/migrations/old.py": "",
    "experiments/trials/threshold/plan.py": 'def fits(kind):\n    return kind == "threshold"\n',
    "analysis/fit.py": '"""Docs."""\nimport numpy as np\n\n# Why.\nx = np.zeros(1)  # noqa: X\n',
    "frontend/src/participant/trials/threshold/screen.ts": 'import { simulate } from "./simulate";\n',
    "frontend/src/participant/trials/threshold/simulate.ts": 'import type { Body } from "./screen";\n',
    "frontend/src/admin/Results.tsx": '// "threshold" below\nif (kind === "threshold") show();\n',
    "frontend/src/admin/icons.ts": 'import "./Results";\n',
    "frontend/src/admin/schema.d.ts": "export {};\n",
    "tests/conftest.py": "def pytest_collection_modifyitems(items):\n    mark(items)\n",
}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """The files above."""
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def values(root: Path) -> dict[str, str]:
    """The rows of a tree, by title."""
    return {row.title: row.value for row in House(root).rows()}


def test_files_and_lines_are_those_of_the_product(tree: Path) -> None:
    found = values(tree)
    assert found["product Python files"] == "10"
    assert found["hand-written TypeScript files"] == "4"
    product = [text for name, text in FILES.items() if not name.startswith("tests") and ".d.ts" not in name]
    assert found["lines of both"] == str(sum(text.count("\n") for text in product))


def test_cycles_count_imports_of_types_alone(tree: Path) -> None:
    house = House(tree)
    assert values(tree)["import cycles, Python"] == "1 (2 files)"
    assert values(tree)["import cycles, TypeScript"] == "1 (among 2 files)"
    cycles = dict(house.lists())["Python import cycles"]
    assert cycles == ["server.models, server.rows"]


def test_a_cycle_is_one_step_of_the_chain(tree: Path) -> None:
    assert longest_chain(House(tree).python_imports, "server") == [
        ["server.app"],
        ["server.models", "server.rows"],
        ["server.words"],
    ]


def test_a_kind_is_compared_outside_its_own_folders_only(tree: Path) -> None:
    assert House(tree).kind_lines == [
        "frontend/src/admin/Results.tsx:2",
        "server/judge.py:2",
    ]


def test_marks_for_tools_and_docstrings_are_not_comments(tree: Path) -> None:
    assert values(tree)["comments per 100 lines"] == f"{100 / 7:.1f}"


@pytest.mark.parametrize(
    ("hook", "value"),
    [
        ("    for one in items: one.add_marker(flaky(reruns=2))\n", "every test"),
        (
            "    for one in items:\n        if one.name in LISTED: one.add_marker(flaky(reruns=2))\n",
            "listed tests only",
        ),
    ],
)
def test_reruns_of_every_test_show(tree: Path, hook: str, value: str) -> None:
    path = tree / "tests" / "conftest.py"
    assert values(tree)["automatic reruns"] == "none"
    path.write_text("def pytest_collection_modifyitems(items):\n" + hook, encoding="utf-8")
    assert values(tree)["automatic reruns"] == value


def test_small_modules_with_one_neighbor_and_long_functions_are_listed(tree: Path) -> None:
    body = "".join(f"    if x == {n}:\n        pass\n" for n in range(13))
    (tree / "server" / "judge.py").write_text(f"def judge(x):\n{body}", encoding="utf-8")
    lists = dict(House(tree).lists())
    assert "server.late <- server.app" in lists["Python modules under 80 lines that one neighbor imports"]
    assert lists["Python functions above 60 lines or 12 branches"] == [
        "server/judge.py:1 judge: 27 lines, 13 branches"
    ]


def test_a_folder_without_the_program_is_refused(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tools.house", "--tree", str(tmp_path)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert "found no Python or no TypeScript files" in done.stderr
