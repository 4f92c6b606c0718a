"""Frames per second in a progress bar."""

from rich.progress import ProgressColumn, Task
from rich.text import Text


class SpeedColumn(ProgressColumn):
    """Shows the rate of a task as frames/s."""

    def render(self, task: Task) -> Text:
        """Text for the current rate; empty before the first frame."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:,.0f} frames/s")
