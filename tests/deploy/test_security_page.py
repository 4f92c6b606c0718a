"""docs/explanation/security-tests.md names tests that there are."""

import ast
import re

from tests.conftest import REPOSITORY

NAMED = re.compile(r"`([a-z_/]+\.py)::(\w+)`")


def test_each_test_that_the_page_names_is_there() -> None:
    named = NAMED.findall(
        (REPOSITORY / "docs" / "explanation" / "security-tests.md").read_text(encoding="utf-8")
    )
    assert len(named) > 30
    for file, name in named:
        path = (
            REPOSITORY
            / "tests"
            / (file.removeprefix("tests/") if file.startswith("tests/") else f"server/{file}")
        )
        functions = {
            node.name
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        }
        assert name in functions, f"{file}::{name}"


def test_each_of_the_thirteen_items_has_its_row() -> None:
    page = (REPOSITORY / "docs" / "explanation" / "security-tests.md").read_text(encoding="utf-8")
    items = {int(item) for item in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)}
    assert items == set(range(1, 14))
