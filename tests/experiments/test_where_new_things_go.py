"""What a new kind of trial, type of scale or field, or language costs in files, shown on a copy of the tree.

Generated files (`make docs`, `npm run api`) do not count. docs/explanation/architecture.md has the numbers.
"""

import json
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tests.experiments.additions.added import FIELD, KIND, LANGUAGE, SCALE, Edit
from tests.experiments.additions.tree import add, copy_tree, ran

FRONTEND = REPOSITORY / "frontend"
pytestmark = [
    pytest.mark.skipif(
        not (FRONTEND / "node_modules").is_dir(), reason="npm packages are not here: run `make test`"
    ),
]


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tree with all of them added."""
    folder = tmp_path_factory.mktemp("tree")
    copy_tree(folder, "frontend")
    (folder / "frontend" / "node_modules").symlink_to(FRONTEND / "node_modules")
    (folder / ".venv").symlink_to(Path(sys.prefix))
    for addition in (SCALE, FIELD, LANGUAGE, KIND):
        add(folder, addition)
    return folder


def test_the_numbers_of_files_are_those_promised() -> None:
    page = (REPOSITORY / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    for row, addition, most in (
        ("kind of trial", KIND, 5),
        ("type of scale", SCALE, 5),
        ("field type", FIELD, 3),
        ("language", LANGUAGE, 2),
    ):
        changed = sum(isinstance(content, Edit) for content in addition.values())
        assert len(addition) <= most, row
        [line] = [line for line in page.splitlines() if line.startswith(f"| {row}")]
        assert line.split("|")[-2].strip().startswith(f"{changed} changed, {len(addition) - changed} new")


def test_the_added_types_are_declared_answered_exported_and_analysed(copy: Path, tmp_path: Path) -> None:
    done = ran(copy, sys.executable, "-m", "tests.experiments.additions.whole", str(tmp_path))
    assert done.returncode == 0, done.stderr[-3000:]
    seen = json.loads(done.stdout)
    assert len(seen["responses"]) == 3 * 10
    assert all(10 <= number <= 500 for number in seen["responses"])
    assert len(seen["dioptres"]) == 3
    assert all(-20 <= number <= 20 for number in seen["dioptres"])
    assert "Scale: 10 (ms) to 500 (ms). Question: How long did it take?" in seen["codebook"]
    assert "report.html" in seen["report"]


def test_the_added_kind_goes_from_its_declaration_to_results_and_report(copy: Path, tmp_path: Path) -> None:
    done = ran(copy, sys.executable, "-m", "tests.experiments.additions.whole_kind", str(tmp_path))
    assert done.returncode == 0, done.stderr[-3000:]
    seen = json.loads(done.stdout)
    # 3 people, 2 characters x 2 speeds x 2 exemplars
    assert (seen["results"]["kind"], seen["results"]["ratings"]) == ("other", 3 * 8)
    assert [(cell["cell"], cell["n"]) for cell in seen["results"]["cells"]] == [
        (cell, 6) for cell in ("a/fast", "a/slow", "b/fast", "b/slow")
    ]
    # Results and the report say the same about the same answers.
    means = {cell["cell"]: pytest.approx(cell["mean"]) for cell in seen["results"]["cells"]}
    assert seen["numbers"]["shares"] == means
    assert "| word | text |" in seen["codebook"]
    assert "report.html" in seen["report"]


def test_the_added_kind_is_like_every_other(copy: Path) -> None:
    done = ran(
        copy,
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "tests/experiments/trials/test_kinds.py",
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert (
        "word_choice"
        in ran(copy, sys.executable, "-c", "from experiments.kinds import KINDS; print(*KINDS)").stdout
    )


def test_the_added_types_have_their_examples_and_effects(copy: Path) -> None:
    tests = ("tests/experiments/test_reference.py", "tests/experiments/schema/test_difference.py")
    done = ran(copy, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests)
    assert done.returncode == 0, done.stdout[-3000:]


def test_the_pages_know_all_of_them_once_types_are_generated(copy: Path) -> None:
    frontend = copy / "frontend"
    made = ran(frontend, "npm", "run", "--silent", "api")
    assert made.returncode == 0, made.stderr
    checked = ran(frontend, "npm", "run", "--silent", "typecheck")
    assert checked.returncode == 0, checked.stdout
    tested = ran(frontend, "npx", "vitest", "run", "tests/unit/types.test.ts", "tests/unit/texts.test.ts")
    assert tested.returncode == 0, tested.stdout[-3000:]
    language = frontend / "src" / "i18n" / "languages" / "sv.json"
    language.write_text('{ "continue": "Fortsätt" }', encoding="utf-8")
    (frontend / "src/participant/trials/scales/magnitude.ts").unlink()
    (frontend / "src/participant/screens/fields/decimal.ts").unlink()
    checked = ran(frontend, "node", "scripts/check_languages.mjs")
    assert checked.returncode == 1
    assert "languages/sv.json: missing keys: try_again, start_study" in checked.stderr
    tested = ran(frontend, "npx", "vitest", "run", "tests/unit/types.test.ts")
    assert tested.returncode != 0
    shown = tested.stdout + tested.stderr
    assert "decimal" in shown
    assert "magnitude" in shown
