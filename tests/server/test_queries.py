"""Queries of the database are in repositories, in `core`, and in three modules about rows themselves."""

import ast
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

SERVER = REPOSITORY / "server"
STATEMENTS = {"select", "insert", "update", "delete", "union", "union_all", "exists", "text"}
CALLED_TO_RUN_ONE = {"execute", "scalar", "scalars", "query", "get_one", "exec_driver_sql"}
ABOUT_ROWS = {"privacy/rows.py", "operations/key_escrow.py", "operations/snapshots.py"}
"""Whole databases, copied row for row or kept as files of SQLite."""
BEGINS_TRANSACTIONS = {"db.py": {"exec_driver_sql"}}
"""BEGIN and BEGIN IMMEDIATE, which are not queries."""


def queries_in(path: Path) -> list[str]:
    """Statements made with SQLAlchemy, and calls of a session or connection that run one, by line."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    made_by_sqlalchemy = STATEMENTS & {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "sqlalchemy"
        for alias in node.names
    }
    allowed = BEGINS_TRANSACTIONS.get(path.name, set())
    queries = []
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id=name)) if name in made_by_sqlalchemy:
                queries.append(f"{node.lineno}: {name}")
            case ast.Call(func=ast.Attribute(value=owner, attr=name)):
                called_on = ast.unparse(owner).rsplit(".", 1)[-1]
                if name in CALLED_TO_RUN_ONE - allowed and called_on.endswith(("session", "connection")):
                    queries.append(f"{node.lineno}: {called_on}.{name}")
                if name == "get" and called_on == "session":
                    queries.append(f"{node.lineno}: {called_on}.{name}")
    return queries


def is_for_queries(path: Path) -> bool:
    """Whether a module may make queries."""
    name = path.relative_to(SERVER).as_posix()
    return name.endswith("repository.py") or name.startswith("core/") or name in ABOUT_ROWS


def test_queries_are_in_repositories() -> None:
    elsewhere = {
        str(path.relative_to(SERVER)): queries
        for path in SERVER.rglob("*.py")
        if not is_for_queries(path) and (queries := queries_in(path))
    }
    assert not elsewhere, f"put these into the folder's repository: {elsewhere}"


@pytest.mark.parametrize(
    "line",
    [
        "    session.scalars(select(1))",
        "    self._session.execute(text('SELECT 1'))",
        "    session.get(Clip, 1)",
        "    connection.exec_driver_sql('SELECT 1')",
        "    session.query(Clip).all()",
    ],
)
def test_a_query_is_seen(tmp_path: Path, line: str) -> None:
    module = tmp_path / "service.py"
    module.write_text(f"from sqlalchemy import select, text\n\n\ndef f(self, session, connection):\n{line}\n")
    assert queries_in(module)
