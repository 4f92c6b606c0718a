"""Refuse names that say nothing of what they hold, and words that the project calls otherwise.

CONTRIBUTING.md says which. A name counts where it is bound: a variable, argument, function, class or field.
Its last word says what it holds, so that one is read: `rows_found` and `Wanted` say as little as `found`.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = (
    "analysis",
    "bench",
    "blink_engine",
    "experiments",
    "server",
    "packages/blender_addon/addon_build",
    "packages/blender_addon/blender_addon",
    "packages/face_baking/face_baking",
    "packages/screen_bench/screen_bench",
    "stimuli_builder",
    "tools",
    "table_files",
    "video_conversion",
)
EMPTY = {"found", "place", "wanted", "who"}
NAMED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.ExceptHandler, ast.MatchAs, ast.MatchStar)
WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
"""One word of a name, in snake case, capitals or camel case."""
KNOWN = {"NotFound", "plays_wanted"}
"""HTTP's own name of status 404; a key by which pages that are open over an update know their trials."""
OTHERWISE = {"most": "max", "film": "clip"}
# A film is what a camera took of a screen, or lies on an eye; the rest of the project shows clips.
FILMS = ("stimuli_builder/sync_patch/", "packages/face_baking/face_baking/")


def names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every name that is bound in a module, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id if isinstance(node, ast.Name) else node.attr
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, NAMED) and node.name:
            yield node.lineno, node.name
        elif isinstance(node, ast.alias) and node.asname:
            yield node.lineno, node.asname


def fault(path: str, name: str) -> str | None:
    """What is wrong with a name, or None."""
    words = WORD.findall(name)
    if words and words[-1].lower() in EMPTY and name not in KNOWN:
        return f"'{name}' does not say what it holds"
    for word, instead in OTHERWISE.items():
        constant = word == "film" or name.isupper()
        if constant and word in name.lower().split("_") and not (word == "film" and path.startswith(FILMS)):
            return f"'{name}': write {instead}, not {word}"
    return None


def faults(path: str, text: str) -> list[str]:
    """The faults of one module, one line each."""
    bound = sorted(set(names(ast.parse(text))))
    return [f"{path}:{line}: {said}" for line, name in bound if (said := fault(path, name))]


def modules(root: Path = ROOT) -> Iterable[Path]:
    """Every module that is checked; tests may name things as they like."""
    return sorted(path for folder in FOLDERS for path in (root / folder).rglob("*.py"))


def main() -> int:
    """Print every fault; 1 where there is one."""
    said = [
        line
        for path in modules()
        for line in faults(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    ]
    print("\n".join(said), end="\n" if said else "")
    return int(bool(said))


if __name__ == "__main__":
    sys.exit(main())
