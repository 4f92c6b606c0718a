"""Import graphs: who imports whom, groups that import one another in a circle, the longest chain.

A graph maps each module (or file) to those it imports.

Python edges: every `import` and `from ... import` of a module, wherever it is written: at the top, inside a
function, under `TYPE_CHECKING`. `from a.b import c` is an edge to `a.b.c` where that is a module, else to
`a.b`; that Python also runs the `__init__` of every package above is not counted. A `__init__.py` is a module
with the package's name.

TypeScript edges: every relative `import`, `export ... from` and `import()`, `import type` included. Generated
files, styles and JSON are not part of the graph.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

Graph = Mapping[str, frozenset[str]]
RELATIVE = re.compile(r"""(?:\bfrom\s*|\bimport\s*\(\s*|\bimport\s+)["'](\.[^"']*)["']""")
COMMENTS = re.compile(r"^\s*(?://|/?\*).*$", re.MULTILINE)


def module_name(path: Path) -> str:
    """Dotted name of a Python file, given relative to the root of the tree."""
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_names(tree: ast.AST, package: str) -> Iterator[tuple[str, str]]:
    """Every import of a module: what it imports from, and the name it takes (empty where it takes all)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: package.count(".") + 2 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from ((base, alias.name) for alias in node.names)


def python_graph(trees: Mapping[Path, ast.AST]) -> dict[str, frozenset[str]]:
    """The import graph of parsed files, whose paths are relative to the root of the tree."""
    modules = {module_name(path): path for path in trees}
    graph = {}
    for module, path in modules.items():
        package = module if path.name == "__init__.py" else module.rpartition(".")[0]
        targets = set()
        for base, name in imported_names(trees[path], package):
            target = f"{base}.{name}" if f"{base}.{name}" in modules else base
            while target and target not in modules:
                target = target.rpartition(".")[0]
            targets.add(target)
        graph[module] = frozenset(targets - {"", module})
    return graph


def typescript_graph(texts: Mapping[Path, str]) -> dict[str, frozenset[str]]:
    """The import graph of TypeScript files."""
    files = {path.resolve(): str(path) for path in texts}
    graph = {}
    for path, text in texts.items():
        targets = set()
        for written in RELATIVE.findall(COMMENTS.sub("", text)):
            plain = (path.parent / written).resolve()
            named = [plain.with_name(plain.name + end) for end in (".ts", ".tsx")]
            # TypeScript may be imported as the JavaScript that it becomes.
            become = [plain.with_suffix(end) for end in (".ts", ".tsx") if plain.suffix in (".js", ".jsx")]
            for one in (plain, *named, *become, plain / "index.ts", plain / "index.tsx"):
                if one in files:
                    targets.add(files[one])
                    break
        graph[str(path)] = frozenset(targets - {str(path)})
    return graph


def connected_groups(graph: Graph) -> list[list[str]]:
    """Strongly connected components, those that are imported before those that import them (Tarjan)."""
    numbers: dict[str, int] = {}
    lowest: dict[str, int] = {}
    waiting: list[str] = []
    groups: list[list[str]] = []
    # In the order of names, so that of two equally long chains the same one is shown every time.
    for start in sorted(graph):
        if start in numbers:
            continue
        # A stack instead of recursion: a long chain of imports would exceed Python's recursion limit.
        steps = [(start, iter(sorted(graph[start])))]
        numbers[start] = lowest[start] = len(numbers)
        waiting.append(start)
        while steps:
            node, targets = steps[-1]
            target = next(targets, None)
            if target is None:
                steps.pop()
                if steps:
                    lowest[steps[-1][0]] = min(lowest[steps[-1][0]], lowest[node])
                if lowest[node] == numbers[node]:
                    at = waiting.index(node)
                    groups.append(sorted(waiting[at:]))
                    del waiting[at:]
            elif target not in numbers:
                numbers[target] = lowest[target] = len(numbers)
                waiting.append(target)
                steps.append((target, iter(sorted(graph[target]))))
            elif target in waiting:
                lowest[node] = min(lowest[node], numbers[target])
    return groups


def import_cycles(graph: Graph) -> list[list[str]]:
    """Groups of two or more modules that reach one another, the largest first."""
    return sorted((group for group in connected_groups(graph) if len(group) > 1), key=len, reverse=True)


def elementary_cycles(graph: Graph, limit: int = 1000) -> int:
    """How many ways lead round in a circle without passing a module twice; counting ends at `limit`."""
    count = 0
    for group in import_cycles(graph):
        members = set(group)
        for start in group:
            paths = [[start]]
            while paths and count < limit:
                path = paths.pop()
                for target in graph[path[-1]] & members:
                    if target == start:
                        count += 1
                    # A circle is counted once, from the first of its names.
                    elif target > start and target not in path:
                        paths.append([*path, target])
    return count


def longest_chain(graph: Graph, package: str) -> list[list[str]]:
    """The longest chain of imports inside a package, the top first; a cycle is one step."""
    inside = {
        module: frozenset(one for one in targets if belongs_to(one, package))
        for module, targets in graph.items()
        if belongs_to(module, package)
    }
    groups = connected_groups(inside)
    group_of = {module: number for number, group in enumerate(groups) for module in group}
    chains: list[list[int]] = []
    for number, group in enumerate(groups):
        below = {group_of[target] for module in group for target in inside[module]} - {number}
        chains.append([number, *max((chains[one] for one in sorted(below)), key=len, default=[])])
    return [groups[number] for number in max(chains, key=len, default=[])]


def belongs_to(module: str, package: str) -> bool:
    """Whether a module is a package or lies below it."""
    return module == package or module.startswith(package + ".")


def lonely_modules(graph: Graph, lines: Mapping[str, int], limit: int) -> Iterable[tuple[str, str]]:
    """Modules under `limit` lines that one other module imports, one of the same folder; with that one."""
    importers: dict[str, set[str]] = {module: set() for module in graph}
    for module, targets in graph.items():
        for target in targets:
            importers[target].add(module)
    for module in sorted(graph):
        if lines[module] < limit and len(importers[module]) == 1:
            (importer,) = importers[module]
            if folder_of(module) in (folder_of(importer), importer):
                yield module, importer


def folder_of(module: str) -> str:
    """The package or folder that a module lies in."""
    return module.rpartition("/" if "/" in module else ".")[0]
