"""Print every row of the table of issue 50, with its target, then the files and functions to look at.

Decision 0985 has the rules.

    python -m tools.house [--tree FOLDER] [--files]

FOLDER is another tree, say of `git archive COMMIT | tar x -C FOLDER`. At a419930e the rows are those of the
issue's column "today", with one exception: comparisons with a trial kind's name are 17 lines in 12 files as
`tools.house.sources` defines them, where the issue counts 19 in 11.

Rows that take minutes to measure are read from `recorded.toml` in this folder, with the commit they were
measured at. `tools.house.graphs` and `tools.house.sources` define the rest. `--files` lists, in full, what
the last lines only count: modules under 80 lines that one neighbor imports, files above 600 lines, Python
functions above 60 lines (docstring apart) or 12 branches, cycles, the longest chain, lines with kind names.
"""

from __future__ import annotations

import argparse
import ast
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tools.house.graphs import (
    elementary_cycles,
    import_cycles,
    lonely_modules,
    longest_chain,
    module_name,
    python_graph,
    typescript_graph,
)
from tools.house.sources import (
    comment_share,
    count_lines,
    kind_comparisons,
    kind_names,
    long_functions,
    python_files,
    typescript_files,
)

ROOT = Path(__file__).resolve().parents[2]
RECORDED = Path(__file__).with_name("recorded.toml")
SMALL, LARGE, LONG, BRANCHES = 80, 600, 60, 12
"""Lines of a module and of a file, lines and branches of a function."""


@dataclass(frozen=True)
class Row:
    """One row of the table; `met` is None where nothing was measured."""

    title: str
    value: str
    target: str
    met: bool | None


@dataclass
class House:
    """What one tree holds.

    Attributes
    ----------
    root : Path
        Folder of the tree.
    """

    root: Path
    python: dict[Path, str] = field(init=False)
    typescript: dict[Path, str] = field(init=False)
    trees: dict[Path, ast.AST] = field(init=False)

    def __post_init__(self) -> None:
        self.python = python_files(self.root)
        self.typescript = typescript_files(self.root)
        if not self.python or not self.typescript:
            sys.exit(f"expected the program's source in {self.root}, found no Python or no TypeScript files")
        self.trees = {path: ast.parse(text) for path, text in self.python.items()}
        self.python_imports = python_graph(self.trees)
        self.typescript_imports = typescript_graph(self.typescript)
        self.texts = {**self.python, **self.typescript}
        self.kind_lines = kind_comparisons(self.texts, self.trees, kind_names(self.typescript))
        self.chain = longest_chain(self.python_imports, "server")

    def rows(self) -> Iterator[Row]:
        """The rows that the tree itself holds, then those recorded."""
        python, pages = len(self.python), len(self.typescript)
        yield Row("product Python files", f"{python:,}", "<= 500", python <= 500)
        yield Row("hand-written TypeScript files", f"{pages:,}", "<= 220", pages <= 220)
        lines = sum(map(count_lines, self.texts.values()))
        yield Row("lines of both", f"{lines:,}", "<= 122,000", lines <= 122_000)
        cycles = [len(group) for group in import_cycles(self.python_imports)]
        sizes = f" ({', '.join(map(str, cycles))} files)" if cycles else ""
        yield Row("import cycles, Python", f"{len(cycles)}{sizes}", "0", not cycles)
        circles = elementary_cycles(self.typescript_imports)
        groups = [len(group) for group in import_cycles(self.typescript_imports)]
        among = f" (among {sum(groups)} files)" if groups else ""
        yield Row("import cycles, TypeScript", f"{circles}{among}", "0", not circles)
        yield Row("longest import chain in server", str(len(self.chain)), "<= 15", len(self.chain) <= 15)
        files = len({line.partition(":")[0] for line in self.kind_lines})
        named = f"{len(self.kind_lines)} lines in {files} files"
        yield Row("comparisons with a trial kind's name", named, "0", not self.kind_lines)
        yield from recorded_rows()
        yield Row("automatic reruns", *self._reruns())
        share = comment_share(self.texts, self.trees)
        yield Row("comments per 100 lines", f"{share:.1f}", "4-8", 4 <= share <= 8)

    def _reruns(self) -> tuple[str, str, bool | None]:
        """Which tests `tests/conftest.py` reruns: a mark outside any condition goes to every test."""
        target, path = "listed by name", self.root / "tests" / "conftest.py"
        if not path.is_file():
            return "no tests/conftest.py", target, None
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if "reruns" not in ast.unparse(tree):
            return "none", target, True
        conditional = {
            id(one) for node in ast.walk(tree) if isinstance(node, ast.If) for one in ast.walk(node)
        }
        marks = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and any(word.arg == "reruns" for word in node.keywords)
        ]
        if any(id(mark) not in conditional for mark in marks):
            return "every test", target, False
        return "listed tests only", target, True

    def lists(self) -> Iterator[tuple[str, list[str]]]:
        """What `--files` prints, by title."""
        pages = {str(path): count_lines(text) for path, text in self.typescript.items()}
        modules = {module_name(path): count_lines(text) for path, text in self.python.items()}
        for graph, lines in ((self.python_imports, modules), (self.typescript_imports, pages)):
            lonely = [f"{one} <- {importer}" for one, importer in lonely_modules(graph, lines, SMALL)]
            language = "TypeScript" if graph is self.typescript_imports else "Python"
            yield f"{language} modules under {SMALL} lines that one neighbor imports", lonely
        lengths = ((count_lines(text), path.as_posix()) for path, text in self.texts.items())
        large = [f"{path}: {lines}" for lines, path in sorted(lengths, reverse=True) if lines > LARGE]
        yield f"files above {LARGE} lines", large
        functions = long_functions(self.trees, LONG, BRANCHES)
        sized = [f"{name}: {lines} lines, {branches} branches" for name, lines, branches in functions]
        yield f"Python functions above {LONG} lines or {BRANCHES} branches", sized
        for language, graph in (("Python", self.python_imports), ("TypeScript", self.typescript_imports)):
            groups = [", ".join(group) for group in import_cycles(graph)]
            yield f"{language} import cycles", groups
        yield "longest import chain in server", [" = ".join(group) for group in self.chain]
        yield "lines that compare with a trial kind's name", self.kind_lines


def recorded_rows() -> Iterator[Row]:
    """Rows that take minutes to measure, as last recorded."""
    tables = tomllib.loads(RECORDED.read_text(encoding="utf-8"))
    newest = {key: (value, commit) for commit, table in tables.items() for key, value in table.items()}

    def row(title: str, key: str, unit: str, limit: float, command: str) -> Row:
        """A row whose figure must not exceed a limit."""
        target = f"<= {limit:g} {unit}"
        if key not in newest:
            return Row(title, f"measure: {command}", target, None)
        value, commit = newest[key]
        return Row(title, f"{value:g} {unit} ({commit})", target, value <= limit)

    yield row("a stranger's export column", "column_lines", "lines", 10, "git show --shortstat COMMIT")
    yield row("a stranger's trial kind", "kind_files", "files", 5, "git show --stat COMMIT")
    yield row("make test, two quiet cores", "test_minutes", "min", 15, "time make test")
    yield row(".ci/run, two quiet cores", "ci_minutes", "min", 20, "time .ci/run")
    result, commit = newest.get("test_all", ("measure: make test-all", ""))
    value = f"{result} ({commit})" if commit else str(result)
    yield Row("make test-all", value, "green", result == "green" if commit else None)
    yield row("largest slowdown", "slower_percent", "%", 5, "bench/before_and_after.py COMMIT 5")


def main(arguments: list[str]) -> int:
    """Print the table, then the lists; 0 always: the plan is a target, not a condition for landing."""
    parser = argparse.ArgumentParser(prog="make house", description=__doc__)
    parser.add_argument("--tree", type=Path, default=ROOT, help="folder of another tree")
    parser.add_argument("--files", action="store_true", help="list the files, functions and lines in full")
    chosen = parser.parse_args(arguments)
    house = House(chosen.tree)
    rows = list(house.rows())
    first, second = max(len(row.title) for row in rows), max(len(row.value) for row in rows)
    for row in rows:
        met = "not measured" if row.met is None else "met" if row.met else "not met"
        print(f"{row.title:<{first}}  {row.value:<{second}}  {row.target:<14}  {met}")
    print()
    for title, lines in house.lists():
        print(f"{title}: {len(lines)}")
        if chosen.files:
            print("".join(f"    {line}\n" for line in lines), end="")
    if not chosen.files:
        print('\nmake house HOUSE="--files" lists them.')
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
