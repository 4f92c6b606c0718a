"""What every bench shares: lines and tables with targets, clocks, earlier revisions, parts of one program."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = Path("../shared/data/face_video")
"""Real recordings with labels, next to the checkout: NAME.mp4 and NAME.points.json."""
MARKS = {True: "yes", False: "NO", None: ""}


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def print_line(name: str, value: str, must: str = "", aim: str = "") -> None:
    """Print one measured value, what it must be and what is aimed at."""
    say(f"{name:<58} {value:>16} {must:>12} {aim:>10}".rstrip())


@dataclass(frozen=True)
class Row:
    """One line of a table; `met` is None where there is no target."""

    scenario: str
    what: str
    measured: str
    target: str = ""
    met: bool | None = None


def console_table(rows: Sequence[Row], title: str) -> Table:
    """The rows for a terminal."""
    table = Table("scenario", "what", "measured", "target", "met", title=title)
    for row in rows:
        table.add_row(row.scenario, row.what, row.measured, row.target, MARKS[row.met])
    return table


def markdown_table(rows: Sequence[Row]) -> str:
    """The rows for the documentation."""
    lines = ["| scenario | what | measured | target | met |", "|---|---|---|---|---|"]
    lines += [
        f"| {row.scenario} | {row.what} | {row.measured} | {row.target} | {MARKS[row.met]} |" for row in rows
    ]
    return "\n".join(lines) + "\n"


def percentile(values: Sequence[float], share: float) -> float:
    """The value below which `share` of them lie; not a number where there is none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else float("nan")


def quantiles(values: Sequence[float], *shares: float) -> str:
    """Quantiles in whole ms, as text."""
    return " / ".join(f"{percentile(values, share):.0f}" for share in shares)


def cpu_times_s(work: Callable[[], object], times: int) -> list[float]:
    """Processor time of this process for each of some runs of `work`."""
    taken = []
    for _ in range(times):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return taken


def cpu_s_of(processes: Sequence[psutil.Process]) -> float:
    """Processor time used by all of them so far, with that of children which have ended."""
    used = 0.0
    for process in processes:
        with suppress(psutil.Error):
            used += sum(process.cpu_times()[:4])
    return used


def with_children(pid: int) -> list[psutil.Process]:
    """A process and all that it has started, the first one first; none where it has ended."""
    with suppress(psutil.NoSuchProcess):
        first = psutil.Process(pid)
        return [first, *first.children(recursive=True)]
    return []


def peak_mb(pid: int) -> float:
    """The highest resident memory of a process so far (Linux)."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


@contextmanager
def earlier_tree(revision: str) -> Iterator[Path]:
    """The files of an earlier revision in a temporary folder, to be measured in turns with these."""
    with tempfile.TemporaryDirectory(prefix="palpebra-earlier-") as folder:
        tree = Path(folder, "tree")
        subprocess.run(["git", "clone", "-q", "--no-checkout", str(ROOT), str(tree)], check=True)
        subprocess.run(["git", "-C", str(tree), "checkout", "-q", revision], check=True)
        yield tree


def figures_of(tree: Path, script: str, *arguments: str | Path, **settings: str) -> Any:
    """What `script measure ARGUMENTS` prints as JSON when it runs on the files of a tree.

    What an earlier tree has not, such as this harness, comes from here.
    """
    environment = os.environ | {"PYTHONPATH": f"{tree}{os.pathsep}{ROOT}"} | settings
    command = [sys.executable, "-P", script, "measure", *map(str, arguments)]
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{tree}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def run_part(parts: Mapping[str, Callable[[], int | None]]) -> int:
    """Run the part that the first argument names; the part reads the arguments after it."""
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in parts:
        sys.stderr.write(f"error: expected one of {', '.join(parts)}, got '{name}'\n")
        return 2
    del sys.argv[1]
    return parts[name]() or 0
