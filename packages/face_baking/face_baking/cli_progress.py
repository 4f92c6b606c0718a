"""Progress of a bake on a terminal, with the time it is expected to take."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

Report = Callable[[int, int, str], None]


@contextmanager
def baking(name: str) -> Iterator[Report]:
    """A function to report (done, total, what) to: a bar on a terminal, else one stderr line per picture."""
    if not sys.stderr.isatty():
        yield _lines(name)
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns) as progress:
        task = progress.add_task(f"baking {name}")

        def report(done: int, total: int, what: str) -> None:
            progress.update(task, completed=done, total=total, description=f"baking {name} ({what})")

        yield report


def _lines(name: str) -> Report:
    began, first = time.monotonic(), -1

    def report(done: int, total: int, what: str) -> None:
        nonlocal first
        first = done if first < 0 else first
        each = (time.monotonic() - began) / (done - first) if done > first else 0.0
        left = f", about {each * (total - done) / 60:.0f} min left" if each else ""
        sys.stderr.write(f"baking {name}: {done}/{total} ({what}{left})\n")
        sys.stderr.flush()

    return report
