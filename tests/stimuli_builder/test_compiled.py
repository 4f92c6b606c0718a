"""Compiled kernels and their cache on disk."""

import ast
import importlib
import sys
from pathlib import Path

import pytest

import stimuli_builder

SOURCES = Path(stimuli_builder.__file__).parent

CALLED = """
from stimuli_builder.compiled import compiled

@compiled
def grown(x):
    return x + {more}
"""
CALLER = """
from stimuli_builder.compiled import compiled_over
import called_kernels

grown = called_kernels.grown

@compiled_over(called_kernels)
def twice_grown(x):
    return 2 * grown(x)
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Write the two files and call the kernel as a new process would: nothing of them is imported yet."""
    monkeypatch.syspath_prepend(tmp_path)

    def call(more):
        (tmp_path / "called_kernels.py").write_text(CALLED.format(more=more))
        caller = tmp_path / "caller_kernels.py"
        if not caller.exists():
            caller.write_text(CALLER)
        for name in ("called_kernels", "caller_kernels"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        kernel = importlib.import_module("caller_kernels").twice_grown
        return kernel(1.0), sum(kernel.stats.cache_hits.values())

    yield call
    for name in ("called_kernels", "caller_kernels"):
        sys.modules.pop(name, None)


def test_a_kernel_is_compiled_again_where_one_that_it_calls_was_edited(run):
    assert run(1) == (4.0, 0)
    assert run(100) == (202.0, 0)


def test_a_kernel_over_other_files_is_read_from_the_cache(run):
    assert run(1) == (4.0, 0)
    for name in ("called_kernels", "caller_kernels"):
        sys.modules.pop(name, None)
    kernel = importlib.import_module("caller_kernels").twice_grown
    assert kernel(1.0) == 4.0
    assert sum(kernel.stats.cache_hits.values()) == 1


def kernels_of(source):
    """Each kernel of a file: its name, the names that its body holds, and what its decorator is over."""
    for node in ast.parse(source).body:
        for decorator in getattr(node, "decorator_list", []):
            over = decorator.args if isinstance(decorator, ast.Call) else []
            called = decorator.func if isinstance(decorator, ast.Call) else decorator
            if getattr(called, "id", "") in ("compiled", "compiled_over"):
                held = {one.id for line in node.body for one in ast.walk(line) if isinstance(one, ast.Name)}
                own = {one.arg for one in node.args.args}
                yield node.name, held - own, {one.id for one in over}


def uncovered(source):
    """Names of other files that kernels hold, even through kernels of the same file, and are not over."""
    modules, origin = {}, {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("stimuli_builder"):
            for one in node.names:
                modules[one.asname or one.name] = f"{node.module}.{one.name}"
                origin[one.asname or one.name] = node.module
    kernels = {name: (held, over) for name, held, over in kernels_of(source)}
    for name, (_, over) in kernels.items():
        reached, fresh = set(), {name}
        while fresh:
            reached |= fresh
            fresh = {other for one in fresh for other in kernels[one][0] & kernels.keys()} - reached
        needed = {one for kernel in reached for one in kernels[kernel][0] & origin.keys()}
        stamped = {modules[one] for one in over}
        yield from ((name, one) for one in sorted(needed) if origin[one] not in stamped)


def test_every_kernel_is_over_the_files_whose_kernels_and_numbers_it_holds():
    files = [path for path in SOURCES.rglob("*.py") if "@compiled" in path.read_text()]
    assert len(files) > 5
    assert {path.name: found for path in files if (found := list(uncovered(path.read_text())))} == {}


def test_a_number_of_another_file_under_a_kernel_of_a_kernel_is_reported():
    source = "from stimuli_builder.a import B\n@compiled\ndef f(x):\n    return B\n"
    caller = "@compiled\ndef g(x):\n    return f(x)\n"
    assert list(uncovered(source + caller)) == [("f", "B"), ("g", "B")]
