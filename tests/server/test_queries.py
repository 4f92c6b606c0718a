"""Queries of the database stand in repositories; the modules that still have some are listed."""

import ast
from pathlib import Path

from tests.conftest import REPOSITORY

SERVER = REPOSITORY / "server"
STATEMENTS = {"select", "insert", "update", "delete", "union_all"}
CALLED_ON_A_SESSION = {"execute", "scalar", "scalars", "query"}
REMAINING = {
    "accounts/audit.py",
    "accounts/endpoints.py",
    "accounts/identity.py",
    "accounts/people.py",
    "accounts/service.py",
    "operations/checks.py",
    "operations/metrics.py",
    "operations/rows.py",
    "runs/erasure.py",
}
"""Modules whose queries are still to be moved into a repository."""


def queries_in(path: Path) -> int:
    """Statements made and calls of a session or connection that run one."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    of_sqlalchemy = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "sqlalchemy"
        for alias in node.names
    }
    number = 0
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        made = isinstance(node.func, ast.Name) and node.func.id in STATEMENTS & of_sqlalchemy
        run = (
            isinstance(node.func, ast.Attribute)
            and node.func.attr in CALLED_ON_A_SESSION
            and isinstance(node.func.value, ast.Name)
            and node.func.value.id in ("session", "connection")
        )
        number += made or run
    return number


def test_no_further_module_outside_the_repositories_has_queries() -> None:
    having = {
        str(path.relative_to(SERVER))
        for path in SERVER.rglob("*.py")
        if not path.name.endswith("repository.py") and queries_in(path)
    }
    assert not having - REMAINING, "put these queries into the folder's repository"


def test_a_query_is_seen(tmp_path: Path) -> None:
    module = tmp_path / "service.py"
    module.write_text("from sqlalchemy import select\n\n\ndef f(session):\n    session.scalars(select(1))\n")
    assert queries_in(module) == 2
