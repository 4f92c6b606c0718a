"""The files that count, and what each of them holds: lines, comments, long functions, kind names.

Which files count:

* Python: every `.py` file of the product packages, `__init__` included, migrations, tests and tools apart.
* TypeScript: every `.ts` and `.tsx` file under `frontend/src`, tests (`*.test.ts`, there are none there) and
  generated ones (`*.d.ts`) apart. Pages made for the playground and demos are hand-written and count.
* Lines: as `wc -l` counts them, blank ones and docstrings included.

Comments per 100 lines: Python comments (not docstrings, `noqa`, `type:`, `pragma`) and TypeScript's `//` and
`/* */` (not `/** */`) of numerics and protocol code. Numerics is every module of `analysis`,
`stimuli_builder` and `blink_engine` that imports numpy or scipy; protocol is what carries an answer from the
page to a committed row: PROTOCOL names the folders, those of today and those of the plan.

A trial kind is compared with its name where a line of Python compares something called `kind` with it (`==`,
`!=`, `in`, `case`) or asks for its declaration's class with `isinstance`, and where a line of TypeScript
quotes it. Kinds are the folders of the participant page that hold a `screen.ts`; their own folders and files
(`.../threshold/...`, `kinds/threshold.py`, `kinds/Threshold.tsx`) may name them, and so may any file in a
folder `kinds`.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

PACKAGES = (
    "server",
    "stimuli_builder",
    "analysis",
    "experiments",
    "table_files",
    "video_conversion",
    "blink_engine",
)
PAGES = Path("frontend/src")
NUMERICS = ("analysis", "stimuli_builder", "blink_engine")
PROTOCOL = (
    "server/participants",
    "server/trials",
    "server/views",
    "server/evidence",
    "server/participation",
    "server/core/commit.py",
    "frontend/src/participant/outbox",
    "frontend/src/participant/playback",
    "frontend/src/participant/preload",
    "frontend/src/participant/trials",
    "frontend/src/participant/kinds",
    "frontend/src/participant/views",
)
MARKS = re.compile(r"#\s*(?:noqa|type:|pragma|!|mypy:)")
TYPESCRIPT_COMMENT = re.compile(r"(?:^|\s)//|/\*(?!\*)")
COMMENT_LINE = re.compile(r"\s*(?://|/?\*)")
BRANCHES = (ast.If, ast.For, ast.AsyncFor, ast.While, ast.ExceptHandler, ast.match_case)
Function = ast.FunctionDef | ast.AsyncFunctionDef


def python_files(root: Path) -> dict[Path, str]:
    """Texts of the product's Python files, by path relative to the root."""
    paths = (path for package in PACKAGES for path in sorted((root / package).rglob("*.py")))
    return {path.relative_to(root): path.read_text(encoding="utf-8") for path in paths}


def typescript_files(root: Path) -> dict[Path, str]:
    """Texts of the hand-written TypeScript files, by path relative to the root."""
    paths = (path for end in ("*.ts", "*.tsx") for path in sorted((root / PAGES).rglob(end)))
    mine = (path for path in paths if not path.name.endswith((".d.ts", ".test.ts", ".test.tsx")))
    return {path.relative_to(root): path.read_text(encoding="utf-8") for path in mine}


def count_lines(text: str) -> int:
    """Lines as `wc -l` counts them."""
    return text.count("\n")


def is_numeric(path: Path, tree: ast.AST) -> bool:
    """Whether a module is numerics: in one of those packages, with numpy or scipy."""
    if path.parts[0] not in NUMERICS:
        return False
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    return bool({name.split(".")[0] for name in names} & {"numpy", "scipy"})


def comments_in(path: Path, text: str) -> int:
    """Comments of a file; instructions to a tool do not count."""
    if path.suffix != ".py":
        return len([line for line in text.splitlines() if TYPESCRIPT_COMMENT.search(line)])
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(token.type == tokenize.COMMENT and not MARKS.match(token.string) for token in tokens)


def comment_share(texts: Mapping[Path, str], trees: Mapping[Path, ast.AST]) -> float:
    """Comments per 100 lines of numerics and protocol code."""
    mine = [
        path
        for path in texts
        if path.as_posix().startswith(PROTOCOL) or (path in trees and is_numeric(path, trees[path]))
    ]
    lines = sum(count_lines(texts[path]) for path in mine)
    return 100 * sum(comments_in(path, texts[path]) for path in mine) / max(1, lines)


def long_functions(
    trees: Mapping[Path, ast.AST], lines: int, branches: int
) -> Iterator[tuple[str, int, int]]:
    """Functions above so many lines (docstring apart) or branches, with both numbers.

    Branches are `if`, `elif`, `for`, `while`, `except` and `case`; those of a function inside count for it
    and for the one around it.
    """
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if not isinstance(node, Function):
                continue
            size = (node.end_lineno or node.lineno) - node.lineno + 1
            if ast.get_docstring(node) is not None:
                size -= (node.body[0].end_lineno or 0) - node.body[0].lineno + 1
            count = sum(isinstance(one, BRANCHES) for one in ast.walk(node))
            if size > lines or count > branches:
                yield f"{path.as_posix()}:{node.lineno} {node.name}", size, count


def kind_names(texts: Iterable[Path]) -> list[str]:
    """The trial kinds of the tree."""
    screens = (path for path in texts if path.name == "screen.ts" and "participant" in path.parts)
    return sorted({path.parent.name for path in screens})


def plain_name(name: str) -> str:
    """A name without the marks that differ between languages: `PairedComparison`, `paired_comparison`."""
    return name.replace("_", "").replace("-", "").lower()


def belongs_to_kind(path: Path, kinds: Sequence[str]) -> bool:
    """Whether a file is a kind's own."""
    parts = {plain_name(part.split(".")[0]) for part in path.parts}
    return "kinds" in parts or not parts.isdisjoint(plain_name(kind) for kind in kinds)


def kind_comparisons(
    texts: Mapping[Path, str], trees: Mapping[Path, ast.AST], kinds: Sequence[str]
) -> list[str]:
    """Lines outside the kinds' folders that compare something with a kind's name: `path:line`."""
    quoted = re.compile("[\"'`](?:" + "|".join(map(re.escape, kinds)) + ")[\"'`]") if kinds else None
    places = set()
    for path, text in texts.items():
        if quoted is None or belongs_to_kind(path, kinds):
            continue
        if path in trees:
            numbers = set(python_comparisons(trees[path], kinds))
        else:
            lines = enumerate(text.splitlines(), 1)
            numbers = {at for at, line in lines if quoted.search(line) and not COMMENT_LINE.match(line)}
        places |= {(path.as_posix(), number) for number in numbers}
    return [f"{path}:{number}" for path, number in sorted(places)]


def python_comparisons(tree: ast.AST, kinds: Sequence[str]) -> Iterator[int]:
    """Line numbers of a module that compare with a kind's name."""
    classes = {"".join(word.title() for word in kind.split("_")) for kind in kinds}
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            constants = {one.value for one in ast.walk(node) if isinstance(one, ast.Constant)}
            # "threshold" is also a word of statistics: a kind is what is called `kind`.
            if constants & set(kinds) and "kind" in ast.unparse(node):
                yield node.lineno
        elif isinstance(node, ast.Match) and "kind" in ast.unparse(node.subject):
            for case in node.cases:
                if {one.value for one in ast.walk(case.pattern) if isinstance(one, ast.Constant)} & set(
                    kinds
                ):
                    yield case.pattern.lineno
        elif (
            isinstance(node, ast.Call)
            and ast.unparse(node.func) == "isinstance"
            and len(node.args) == 2
            and {one.id for one in ast.walk(node.args[1]) if isinstance(one, ast.Name)} & classes
        ):
            yield node.lineno
