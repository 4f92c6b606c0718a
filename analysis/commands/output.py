"""What the commands on models and synthetic data share: tables, JSON, a spinner."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from analysis.report.formats import Table

JsonOption = Annotated[Path | None, typer.Option(help="Write every number to this JSON file.")]


def names_in(text: str) -> list[str]:
    """Column names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def show_tables(*tables: "Table") -> None:
    """Print tables, at most 80 columns wide."""
    from analysis.report.formats import as_text

    for table in tables:
        typer.echo("\n" + as_text(table))


def save_json(path: Path | None, numbers: dict[str, Any], synthetic: bool) -> None:
    """Write numbers to a JSON file, whole or not at all; nothing where no path is given."""
    from experiments.files import whole_file
    from experiments.json import json_text

    if path is None:
        return
    with whole_file(path) as temporary:
        temporary.write_text(json_text({"synthetic": synthetic, **numbers}), encoding="utf-8")
    typer.echo(f"\nwritten: {path}")


@contextmanager
def working(what: str) -> Iterator[None]:
    """A spinner on a terminal, silence elsewhere."""
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_terminal:
        with console.status(what):
            yield
    else:
        yield
