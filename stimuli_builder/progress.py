"""Progress bars on stderr; silent if stderr is not a terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class SpeedColumn(ProgressColumn):
    """Shows the rate of a task as frames/s."""

    def render(self, task: Task) -> Text:
        """Text for the current rate; empty before the first frame."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:,.0f} frames/s")


def frame_progress() -> Progress:
    """Progress of a job counted in frames."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        SpeedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True, markup=False),
        disable=not sys.stderr.isatty(),
    )


@contextmanager
def step_progress(description: str, total: int) -> Iterator[Callable[[], None]]:
    """Progress of a job of a few long steps; call what is yielded after each."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=Console(stderr=True, markup=False), disable=not sys.stderr.isatty()
    ) as progress:
        task = progress.add_task(description, total=total)
        yield lambda: progress.advance(task)
