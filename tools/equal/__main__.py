"""Make the outputs of two versions of the program and compare them byte for byte.

    make equal BASE=COMMIT [PARTS="help exports"]
    python -m tools.equal COMMIT [PART ...] [--jobs 1]

BASE is checked out into a temporary folder; the other side is the working tree as it is. Both run with the
packages of this tree's .venv, so their lock files must be equal. Outputs of BASE are kept under build/equal
and used by the next comparison with the same commit, harness and golden files. Exit status: 0 where all is
equal or declared (declared_differences.toml), 1 where something differs, 2 where outputs could not be made.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from fnmatch import fnmatch
from pathlib import Path

from tools.equal.compare import (
    Declared,
    Difference,
    NothingToCompareError,
    compare_folders,
    declared_differences,
    files_below,
)
from tools.equal.normalize import normalize_folder
from tools.equal.parts import DATABASES, PARTS
from tools.equal.sides import HERE, ROOT, PartError, Side, differing_locks, git, worktree

CACHE = ROOT / "build" / "equal"
HEAD_FOLDER = CACHE / "head"
SHOWN = 10
"""Differing files of a part that are printed."""


def harness_key() -> str:
    """Hash of what decides the outputs of a commit besides the commit: harness and golden inputs."""
    digest = hashlib.sha256()
    inputs = [HERE / name for name in ("launch.py", "normalize.py", "parts.py", "probes.py", "sides.py")]
    for path in [*inputs, *sorted(DATABASES.glob("*.sqlite.gz"))]:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:8]


def make_outputs(side: Side, part: str, folder: Path) -> float:
    """Write a part's files, normalized; seconds it took."""
    begun, now = time.monotonic(), datetime.now(UTC)
    # Programs break lines by the length of paths: both sides write to a path of the same length.
    with tempfile.TemporaryDirectory(prefix="equal-out-") as temporary:
        out = Path(temporary) / "out"
        PARTS[part](side, out)
        files_below(out)
        normalize_folder(part, out, side.tree, now)
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(out, folder)
    return time.monotonic() - begun


def make_base(side: Side, part: str, folder: Path) -> float:
    """As `make_outputs`, unless they are there."""
    return 0.0 if folder.is_dir() else make_outputs(side, part, folder)


@dataclass(frozen=True)
class Comparison:
    """Two sides, the folders of their outputs, and the differences that are declared."""

    base: Side
    head: Side
    base_outputs: Path
    head_outputs: Path
    declared: Sequence[Declared] = ()

    def part(self, name: str, jobs: int) -> list[Difference]:
        """Make and compare one part, print a line on it, and return its differences."""
        before, after = self.base_outputs / name, self.head_outputs / name
        with ThreadPoolExecutor(jobs) as pool:
            made = [pool.submit(make_base, self.base, name, before)]
            made.append(pool.submit(make_outputs, self.head, name, after))
            seconds = [one.result() for one in made]
        count, differences = compare_folders(name, before, after, self.declared)
        fresh = [one for one in differences if not one.reason]
        verdict = f"{len(fresh)} differ" if fresh else "equal"
        if len(differences) > len(fresh):
            verdict += f", {len(differences) - len(fresh)} differ as declared"
        kept = f"{seconds[0]:.0f} s" if seconds[0] else "kept"
        print(f"{name:12} {count:5} files  base {kept:>5}, head {seconds[1]:.0f} s  {verdict}", flush=True)
        for one in fresh[:SHOWN]:
            print(f"  {one.path}: {one.detail}", flush=True)
        if len(fresh) > SHOWN:
            print(f"  and {len(fresh) - SHOWN} more; compare {before} with {after}", flush=True)
        return differences


def unused_declarations(declared: Sequence[Declared], differences: Sequence[Difference]) -> list[str]:
    """Patterns of declared differences that no file showed."""
    paths = [one.path for one in differences]
    return [rule.path for rule in declared if not any(fnmatch(path, rule.path) for path in paths)]


def main(arguments: list[str]) -> int:
    """Compare; see above."""
    parser = argparse.ArgumentParser(prog="make equal", description=__doc__.splitlines()[0])
    parser.add_argument("base", help="commit to compare the working tree with")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help=f"of {', '.join(PARTS)}")
    parser.add_argument("--jobs", type=int, default=2, help="sides at the same time: 1 or 2")
    chosen = parser.parse_args(arguments)
    parts = chosen.parts or list(PARTS)
    commit = git("rev-parse", "--verify", f"{chosen.base}^{{commit}}")
    if differing := differing_locks(commit):
        print(f"error: {', '.join(differing)}: not equal in {chosen.base} and here; choose a BASE with the")
        print("packages of the working tree, and compare a change of packages by itself")
        return 2
    cache = CACHE / f"{commit[:12]}-{harness_key()}"
    begun, declared = time.monotonic(), declared_differences()
    print(f"base {commit[:12]}, head the working tree; parts: {' '.join(parts)}", flush=True)
    try:
        with ExitStack() as stack:
            complete = all((cache / part).is_dir() for part in parts)
            tree = CACHE if complete else stack.enter_context(worktree(commit))
            comparison = Comparison(Side("base", tree), Side("head", ROOT), cache, HEAD_FOLDER, declared)
            differences = [one for part in parts for one in comparison.part(part, chosen.jobs)]
    except (PartError, NothingToCompareError) as error:
        print(f"error: {error}")
        return 2
    if len(parts) == len(PARTS):
        for path in unused_declarations(declared, differences):
            print(f"declared, but nothing differs: {path}")
    undeclared = sum(not one.reason for one in differences)
    verdict = f"{undeclared} files differ" if undeclared else "equal"
    print(f"{verdict} ({time.monotonic() - begun:.0f} s)")
    return int(bool(undeclared))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
