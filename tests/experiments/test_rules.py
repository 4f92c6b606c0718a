"""A rule that can be declared is applied, or the type-checker says so."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.rules.warnings import WarnFast, WarnPattern, WarnSameAnswer
from tests.conftest import REPOSITORY

NEW = '''from typing import Literal

from {module} import {base}


class NewRule({base}):
    """A rule that nothing applies."""

    rule: Literal["new_rule"] = "new_rule"
'''
BASE, EXCLUSION = "experiments.declaration.base", "experiments.rules.exclusions"
SETTINGS = "[mypy]\nfollow_imports = skip\nignore_missing_imports = True\n"
PYDANTIC = "from typing import Any\nclass BaseModel: ...\ndef __getattr__(name: str) -> Any: ...\n"
"""Enough of it for the classes to be classes; the whole would take the checker ten seconds."""


@pytest.fixture(scope="module")
def checked_before(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checker's cache: the standard library need be read only once. What changes is read anew."""
    return tmp_path_factory.mktemp("cache")


@pytest.mark.parametrize(
    ("union", "user", "module", "base", "complaint"),
    [
        (
            "ExclusionRule = Annotated[",
            "analysis/plans/exclusions.py",
            BASE,
            "Declaration",
            'Argument 1 to "assert_never"',
        ),
        (
            "ExclusionRule = Annotated[",
            "analysis/plans/exclusions.py",
            EXCLUSION,
            "LeavesOutRuns",
            'has no attribute "excludes"',
        ),
        (
            "ExclusionRule = Annotated[",
            "analysis/plans/exclusions.py",
            EXCLUSION,
            "LeavesOutTrials",
            'has no attribute "drops"',
        ),
        (
            "WarningRule = Annotated[",
            "server/participation/warnings.py",
            "experiments.rules.warnings",
            "Warns",
            'has no attribute "lapses"',
        ),
        (
            "ScreeningRule = Annotated[",
            "server/participation/current_run.py",
            BASE,
            "Declaration",
            'Argument 1 to "assert_never"',
        ),
    ],
)
def test_a_rule_without_its_finder_fails_type_checking(
    tmp_path: Path, checked_before: Path, union: str, user: str, module: str, base: str, complaint: str
) -> None:
    for folder in ("rules", "definition"):
        shutil.copytree(REPOSITORY / "experiments" / folder, tmp_path / "experiments" / folder)
    for needed in ("base", "errors", "__init__"):
        shutil.copy(REPOSITORY / "experiments" / f"{needed}.py", tmp_path / "experiments")
    (tmp_path / "mypy.ini").write_text(SETTINGS)
    (tmp_path / "pydantic.pyi").write_text(PYDANTIC)
    (tmp_path / user).parent.mkdir(parents=True)
    shutil.copy(REPOSITORY / user, tmp_path / user)
    rules = tmp_path / "experiments" / "rules" / "__init__.py"
    (rules.parent / "new_rule.py").write_text(NEW.format(module=module, base=base))
    text = rules.read_text(encoding="utf-8")
    assert union in text
    text = text.replace(union, f"{union}NewRule | ", 1)
    rules.write_text(f"from experiments.rules.new_rule import NewRule\n{text}")
    complaints = unhandled(tmp_path, user, checked_before)
    assert len(complaints) == 1
    assert complaint in complaints[0]


def unhandled(folder: Path, user: str, cache: Path) -> list[str]:
    """What mypy says of the new rule, in the copied files alone."""
    copied = [str(path.relative_to(folder)) for path in (folder / "experiments").rglob("*.py")]
    command = [sys.executable, "-m", "mypy", f"--cache-dir={cache}", "pydantic.pyi", user, *copied]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
    return [line for line in done.stdout.splitlines() if "NewRule" in line]


def test_warnings_have_words_in_every_language_of_the_page() -> None:
    pages = REPOSITORY / "frontend" / "src" / "i18n" / "languages"
    languages = {path.stem for path in pages.glob("*.ts")}
    assert len(languages) >= 11
    for rule in (WarnFast, WarnPattern, WarnSameAnswer):
        words = rule().text
        assert set(words) == languages
        assert len({text.split("\n", 1)[1] for text in words.values()}) == len(languages)
        assert all(text.startswith("# ") for text in words.values())
