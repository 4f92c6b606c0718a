"""Compiled kernels and their cache on disk."""

import importlib
import sys

import pytest

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


def test_a_kernel_is_compiled_anew_where_one_that_it_calls_was_edited(run):
    assert run(1) == (4.0, 0)
    assert run(100) == (202.0, 0)


def test_a_kernel_over_other_files_is_read_from_the_cache(run, monkeypatch):
    assert run(1) == (4.0, 0)
    for name in ("called_kernels", "caller_kernels"):
        sys.modules.pop(name, None)
    kernel = importlib.import_module("caller_kernels").twice_grown
    assert kernel(1.0) == 4.0
    assert sum(kernel.stats.cache_hits.values()) == 1
