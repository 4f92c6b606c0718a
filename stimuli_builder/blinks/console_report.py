"""What `stimuli blinks` prints: a table of the columns, and a line for all that is not plain."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.errors import counted
from stimuli_builder.blinks.review import Review

FEW_BLINKS = 3
"""Fewer than these say nothing of how far this person's lids close at most."""
MAX_NAME = 17
"""Letters of a column's name beside which the figures keep their width on a screen of 80."""
HEADERS = ("blinks", "/min", "complete", "rejected", "down", "up", "total", "closure")


def print_blinks(summaries: Sequence[dict[str, Any]], lost: Sequence[Review], *, closed_given: bool) -> None:
    """Print the table of all columns, and below it what was left out and seen besides."""
    console = Console(markup=False, highlight=False)  # names of columns are no markup: left [mm]
    table = Table(box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column("column", no_wrap=True)
    for header in HEADERS:
        table.add_column(header, justify="right", no_wrap=True)
    table.caption, table.caption_justify = "down, up, total in ms; these and closure: medians", "left"
    for row in summaries:
        medians = [_median(row[name], 0) for name in ("down_ms", "up_ms", "duration_ms")]
        counts = [str(row["blinks"]), f"{row['rate_per_minute']:.1f}", str(row["complete"])]
        table.add_row(
            Text(shortened(row["column"])),
            *counts,
            str(row["rejected"]),
            *medians,
            _median(row["closure"], 2),
        )
    console.print(table)
    for row in summaries:
        for line in _column_lines(row, closed_given=closed_given):
            console.print(f"{row['column']}: {line}")
    for review in lost:
        console.print(
            f"the review names a blink at frame {review.minimum_frame} of {review.column}: none is there"
        )


def shortened(name: str, longest: int = MAX_NAME) -> str:
    """A name of at most `longest` letters, an ellipsis for its middle: both ends tell columns apart."""
    if len(name) <= longest:
        return name
    end = (longest - 1) // 2
    return f"{name[: longest - 1 - end]}…{name[-end:]}"


def _column_lines(row: dict[str, Any], *, closed_given: bool) -> list[str]:
    lines = []
    if 0 < row["blinks"] < FEW_BLINKS and not closed_given:
        lines.append(
            "too few blinks to say which are complete: closed is what they themselves reach; give --closed "
            "where it is known"
        )
    lines += [f"minimum at frame {one['minimum']} left out: {one['reason']}" for one in row["refused"]]
    if row["other_events"]:
        kinds = [f"{count} {kind.replace('_', ' ')}" for kind, count in row["other_events"].items()]
        lines.append(f"besides blinks: {', '.join(kinds)}")
    if row["missing_frames"]:
        lines.append(f"{row['missing_frames']} frames without a value were left out")
    if row["bridged_frames"]:
        lines.append(f"{row['bridged_frames']} frames in short gaps were filled")
    return lines


def print_written(blinks: int, written: Iterable[Path | None]) -> None:
    """Print how many blinks there are in all columns, and the files that were written."""
    paths = ", ".join(str(path) for path in written if path is not None)
    Console(markup=False, highlight=False).print(f"{counted(blinks, 'blink')}; wrote {paths}")


def _median(spread: Mapping[str, float], digits: int) -> str:
    return f"{spread['median']:.{digits}f}" if spread else "-"
