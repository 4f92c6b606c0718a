"""Change the same expressions in two versions of the program and count how many changes their tests notice.

    python -m tools.mutation_sample BASE --tree FOLDER --count 200 --minutes 90

FOLDER holds a checkout of BASE (`git worktree add FOLDER BASE`). An expression is taken only if the same
line, in a function of the same name, exists once in both versions. For each one the tests that import its
module run in both versions, until the first failure, and the test that failed runs again without the change.
Results are appended to `tools/house/mutation.jsonl` as they come, so a run that was stopped continues, also
at a later commit: its expressions stay in the sample. Without `--minutes` it runs to the end. The last lines
are the killed shares of both versions.

An expression runs with at most six test files, and moved code has other ones among its first six. So where
one version notices a change and the other does not, `--settle` runs the other again with every file that
imports the module, and marks the row as `settled`.
"""

from __future__ import annotations

import argparse
import ast
import compileall
import copy
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("server", "analysis", "experiments", "stimuli_builder", "blink_engine", "video_conversion")
RESULTS = ROOT / "tools" / "house" / "mutation.jsonl"
SECONDS, SETTLE_SECONDS = 300, 1800
"""Most processor seconds for the tests of one expression: a change that makes them loop counts as noticed.

Not seconds of the clock, or a busy machine would count as a loop. A run that only waits ends after four times
as long.
"""
MAX_FILES = 6
BROKEN_MAX = 5
SLOW = re.compile(r"tests/(browser|experiments_e2e|docs|bench|scope|equal|house|server/attacks)")
SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


@dataclass(frozen=True)
class Site:
    """One operator in one version: where it is, and how it is known in another version."""

    file: Path
    line: int
    column: int
    function: str
    text: str

    @property
    def key(self) -> str:
        """The same in every version that has the line in a function of this name."""
        return f"{self.function}|{self.text}|{self.column}"


def sites_in(tree: Path) -> dict[str, Site]:
    """Every operator whose function and line are unique in a version."""
    by_key: dict[str, list[Site]] = {}
    for package in PACKAGES:
        for file in sorted((tree / package).rglob("*.py")):
            for site in _sites(file):
                by_key.setdefault(site.key, []).append(site)
    return {key: sites[0] for key, sites in by_key.items() if len(sites) == 1}


def _sites(file: Path) -> Iterator[Site]:
    source = file.read_text(encoding="utf-8")
    lines = source.splitlines()
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.Compare | ast.BinOp | ast.BoolOp) and _operator(node) in SWAPS:
                text = lines[node.lineno - 1]
                indent = len(text) - len(text.lstrip())
                yield Site(file, node.lineno, node.col_offset - indent, function.name, text.strip())


def _operator(node: ast.Compare | ast.BinOp | ast.BoolOp) -> type[ast.AST]:
    return type(node.ops[0]) if isinstance(node, ast.Compare) else type(node.op)


def changed_source(site: Site) -> str:
    """The module with this one operator replaced."""
    tree = copy.deepcopy(ast.parse(site.file.read_text(encoding="utf-8")))
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare | ast.BinOp | ast.BoolOp) and node.lineno == site.line:
            text = site.file.read_text(encoding="utf-8").splitlines()[site.line - 1]
            if node.col_offset - (len(text) - len(text.lstrip())) != site.column:
                continue
            other = SWAPS[_operator(node)]()
            if isinstance(node, ast.Compare):
                node.ops[0] = other  # type: ignore[call-overload]
            else:
                node.op = other  # type: ignore[assignment]
            break
    return ast.unparse(tree)


def tests_of(site: Site, tree: Path, most: int | None) -> list[str]:
    """The test files that import a module, those that name its function first; else those near it."""
    file = site.file
    module = ".".join(file.relative_to(tree).with_suffix("").parts)
    parent, name = module.rpartition(".")[::2]
    imports = re.compile(rf"(from|import) {re.escape(module)}\b|from {re.escape(parent)} import .*\b{name}\b")
    tests = [path for path in sorted((tree / "tests").rglob("test_*.py")) if not SLOW.search(str(path))]
    direct = [path for path in tests if imports.search(path.read_text(encoding="utf-8"))]
    near = [path for path in tests if path.parent.name == file.parent.name]
    named = sorted(direct or near, key=lambda path: site.function not in path.read_text(encoding="utf-8"))
    return [str(path.relative_to(tree)) for path in named[:most]]


class Trials:
    """Runs tests in one version, each time in a fresh copy of a process that has the libraries loaded."""

    def __init__(self, tree: Path, seconds: int) -> None:
        """Compile the version, and start the process that is copied, which gives each run so many seconds."""
        self.tree = tree
        self.short = ["-m", "not long"] if (tree / "tests" / "tiers.toml").is_file() else []
        for package in (*PACKAGES, "tests"):
            compileall.compile_dir(str(tree / package), quiet=2)
        # A module changed twice in a second would be taken from the compiled file of the first change.
        environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", PROCESS, str(seconds)],
            cwd=tree,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def first_failure(self, tests: Sequence[str], without: Sequence[str] = ()) -> str | None:
        """The first test that fails (or `""` where the run itself ended badly), and None where all pass."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        skipped = [f"--deselect={name}" for name in without]
        self.process.stdin.write(json.dumps(["-q", "-x", "-n", "0", *self.short, *skipped, *tests]) + "\n")
        self.process.stdin.flush()
        failure: str | None = json.loads(self.process.stdout.readline())
        return failure


PROCESS = """
import importlib, json, os, resource, signal, sys, tempfile, time

LIBRARIES = "numpy scipy.stats pandas statsmodels.api pingouin sqlalchemy pydantic cv2"
for name in LIBRARIES.split():
    importlib.import_module(name)
sys.path.insert(0, os.getcwd())


class Noted:
    failed = None

    def pytest_runtest_logreport(self, report):
        if report.failed and self.failed is None:
            self.failed = report.nodeid


def run(arguments, answer):
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[1]), int(sys.argv[1])))
    silent = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(silent, number)
    noted = Noted()
    code = pytest.main(arguments, plugins=[noted])
    with open(answer, "w") as file:
        json.dump(None if code in (0, 5) else noted.failed or "", file)
    os._exit(0)


import pytest

for line in sys.stdin:
    with tempfile.TemporaryDirectory() as folder:
        answer = os.path.join(folder, "answer")
        child = os.fork()
        if child == 0:
            run(json.loads(line), answer)
        until = time.monotonic() + 4 * int(sys.argv[1])
        while os.waitpid(child, os.WNOHANG) == (0, 0) and time.monotonic() < until:
            time.sleep(0.02)
        try:
            os.killpg(child, signal.SIGKILL)
        except ProcessLookupError:
            pass
        failure = open(answer).read() if os.path.exists(answer) else json.dumps("")
    print(failure, flush=True)
"""


def outcome(site: Site, trials: Trials, most: int | None = MAX_FILES) -> str:
    """`killed`, `survived`, or `untested` where no test imports the module or all that fail do so anyway."""
    tests = tests_of(site, trials.tree, most)
    original = site.file.read_text(encoding="utf-8")
    broken: list[str] = []
    while tests:
        try:
            site.file.write_text(changed_source(site), encoding="utf-8")
            failure = trials.first_failure(tests, broken)
        finally:
            site.file.write_text(original, encoding="utf-8")
        if failure is None:
            return "survived"
        if trials.first_failure([failure] if failure else tests, broken) is None:
            return "killed"
        if not failure or len(broken) == BROKEN_MAX:
            return "untested"
        broken.append(failure)
    return "untested"


def settle(
    rows: dict[str, dict[str, object]], sides: dict[str, tuple[dict[str, Site], Trials]], results: Path
) -> None:
    """Run every test of the side that did not notice a change which the other noticed."""
    for key, row in rows.items():
        missed = [side for side in sides if row[side] != "killed"]
        if len(missed) != 1 or "settled" in row:
            continue
        sites, trials = sides[missed[0]]
        if key not in sites:  # a later commit has changed the line
            continue
        row[missed[0]] = outcome(sites[key], trials, None)
        row["settled"] = True
        results.write_text("".join(json.dumps(one) + "\n" for one in rows.values()), encoding="utf-8")
        print(f"{row['before']:9} {row['after']:9} {key[:90]}", flush=True)


def main() -> int:
    """Run the sample, or go on with it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("base")
    parser.add_argument("--tree", type=Path, required=True, help="a checkout of BASE")
    parser.add_argument("--here", type=Path, default=ROOT, help="a checkout of the newer version")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--settle", action="store_true", help="run more tests where the versions differ")
    given = parser.parse_args()
    # Else a stop by a signal would leave a changed expression in the tree.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    before, after = sites_in(given.tree.resolve()), sites_in(given.here.resolve())
    given.results.parent.mkdir(exist_ok=True)
    lines = given.results.read_text(encoding="utf-8").splitlines() if given.results.is_file() else []
    known = {row["key"]: row for row in map(json.loads, lines)}
    # What was tried stays, though later commits change what there is to choose from.
    left = sorted((set(before) & set(after)) - set(known))
    more = random.Random(50).sample(left, max(0, given.count - len(known)))
    chosen = [*known, *more][: given.count]
    until = time.monotonic() + given.minutes * 60
    seconds = SETTLE_SECONDS if given.settle else SECONDS
    old, new = Trials(given.tree.resolve(), seconds), Trials(given.here.resolve(), seconds)
    if given.settle:
        settle(known, {"before": (before, old), "after": (after, new)}, given.results)
        chosen = list(known)
    for key in chosen:
        if key in known or time.monotonic() > until:
            continue
        row = {"key": key, "base": given.base}
        row["before"] = outcome(before[key], old)
        row["after"] = outcome(after[key], new)
        known[key] = row
        with given.results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(f"{row['before']:9} {row['after']:9} {key[:90]}", flush=True)
    rows = [known[key] for key in chosen if key in known]
    both = [row for row in rows if "untested" not in (row["before"], row["after"])]
    for side in ("before", "after"):
        killed = sum(row[side] == "killed" for row in both)
        print(f"{side}: {killed} of {len(both)} killed ({len(rows)} of {given.count} tried)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
