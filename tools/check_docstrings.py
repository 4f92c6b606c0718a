"""Refuse docstrings that numpydoc cannot read, or that describe parameters and fields outside its sections.

The help of a command is its docstring, with plain `Examples:` and no sections; it is checked all the same.
"""

from __future__ import annotations

import ast
import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Mapping

from numpydoc.docscrape import NumpyDocString, Parameter

from tools.check_names import ROOT, modules

Documented = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
NAMES = re.compile(r"[*`]{0,3}\w+`{0,2}(?:, [*`]{0,3}\w+`{0,2})*")
ERROR = re.compile(r"[A-Z]\w*(?:\.[A-Z]\w*)*(?:, [A-Z]\w*)*")
SENTENCE = re.compile(r"\.$|[.;] |[a-z] (?:is|are|was|were|has|have) ")
"""What a type never looks like: a description is indented on the next line."""


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    """Names of a function's parameters."""
    spec = function.args
    every = [*spec.posonlyargs, *spec.args, *spec.kwonlyargs, spec.vararg, spec.kwarg]
    return {argument.arg for argument in every if argument} - {"self", "cls"}


def fields(of: ast.ClassDef) -> set[str]:
    """Names that a class may speak of: fields, properties, what it is made with, what it sets of itself."""
    names = set()
    for node in ast.walk(of):
        if isinstance(node, ast.AnnAssign | ast.Assign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            parts = [part for target in targets for part in ast.walk(target)]
            names |= {part.id for part in parts if isinstance(part, ast.Name) and node in of.body}
            names |= {part.attr for part in parts if isinstance(part, ast.Attribute)}
        elif isinstance(node, ast.FunctionDef) and node in of.body:
            names |= arguments(node) if node.name == "__init__" else {node.name}
    return names


def known_names(node: Documented, classes: Mapping[str, ast.ClassDef]) -> set[str]:
    """What the entries of a docstring may be called; a class has the fields of those it is made from, too."""
    if not isinstance(node, ast.ClassDef):
        return arguments(node)
    bases = [classes[name] for base in node.bases if (name := ast.unparse(base).split(".")[-1]) in classes]
    return fields(node).union(*(known_names(base, classes) for base in bases if base is not node))


def read(text: str) -> tuple[NumpyDocString | None, str | None]:
    """A docstring as numpydoc reads it, or its complaint."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return NumpyDocString(text), None
        except (ValueError, UserWarning) as error:
            return None, " ".join(str(error).split("\n")[0].split())


def entry_fault(entry: Parameter, names: set[str]) -> str | None:
    """What is wrong with one entry of Parameters or Attributes."""
    if not NAMES.fullmatch(entry.name):
        return f"'{entry.name}' is not an entry: write `name : type`, the description indented below"
    called = {part.strip("*` ") for part in entry.name.split(",")}
    if called - names:
        return f"'{', '.join(sorted(called - names))}' is not a parameter or field"
    if not entry.type or SENTENCE.search(entry.type):
        return f"'{entry.name}' has no type: write `{entry.name} : type`, the description indented below"
    return None


def leftovers(prose: Iterable[str], names: set[str]) -> Iterator[str]:
    """Names that prose explains as `name: text`, which belongs into a section."""
    if names:
        each = "|".join(sorted(names))
        listed = re.compile(rf"(?:^|[.;] )(?:`?(?:{each})`?, )*`?({each})`?: (?=\S)", re.MULTILINE)
        yield from (match[1] for match in listed.finditer("\n".join(prose)))


def docstring_faults(text: str, names: set[str]) -> Iterator[str]:
    """The faults of one docstring."""
    parsed, complaint = read(text)
    if parsed is None:
        yield f"numpydoc cannot read it: {complaint}"
        return
    if not any(parsed["Summary"]):
        yield "it has no summary"
    entries = [*parsed["Parameters"], *parsed["Other Parameters"], *parsed["Attributes"]]
    for entry in entries:
        if said := entry_fault(entry, names):
            yield said
    for entry in parsed["Raises"]:
        if not ERROR.fullmatch(entry.type):
            yield (
                f"'{entry.name or entry.type}' is not an error: write its name, the description indented "
                "below"
            )
    prose = [*parsed["Summary"], *parsed["Extended Summary"], *parsed["Notes"]]
    for name in leftovers(prose + [line for entry in entries for line in entry.desc], names):
        yield f"'{name}: ...' belongs into a section Parameters or Attributes"


def documented(tree: ast.AST) -> Iterator[tuple[Documented, str]]:
    """Every class and function of a module that has a docstring."""
    for node in ast.walk(tree):
        if isinstance(node, Documented) and (text := ast.get_docstring(node)):
            yield node, text


def faults(path: str, text: str, classes: Mapping[str, ast.ClassDef] | None = None) -> list[str]:
    """The faults of one module, one line each; `classes` of all modules give inherited fields."""
    tree = ast.parse(text)
    return [
        f"{path}:{node.lineno}: {node.name}: {said}"
        for node, doc in documented(tree)
        for said in docstring_faults(doc, known_names(node, classes or {}))
    ]


def main() -> int:
    """Print every fault; 1 where there is one."""
    texts = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in modules()}
    trees = [ast.parse(text) for text in texts.values()]
    classes = {node.name: node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    said = [line for path, text in texts.items() for line in faults(path, text, classes)]
    print("\n".join(said) or f"docstrings: {len(texts)} modules, no faults")
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
