"""What the commands on models and synthetic data share: tables, JSON, a spinner."""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

if TYPE_CHECKING:
    from analysis.formats import Table

JsonOption = Annotated[Path | None, typer.Option(help="Write every number to this JSON file.")]


def show_tables(*tables: "Table") -> None:
    """Print tables, at most 80 columns wide."""
    from analysis.formats import as_text

    for table in tables:
        typer.echo("\n" + as_text(table))


def save_json(path: Path | None, numbers: dict[str, Any], synthetic: bool) -> None:
    """Write numbers to a JSON file, whole or not at all; nothing where no path is given."""
    from analysis.files import whole_file

    if path is None:
        return
    text = json.dumps(_finite({"synthetic": synthetic, **numbers}), indent=2, ensure_ascii=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    typer.echo(f"\nwritten: {path}")


def _finite(value: Any) -> Any:
    """JSON has no NaN: what is undefined becomes null."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def working(what: str) -> Iterator[None]:
    """A spinner on a terminal, silence elsewhere."""
    console = Console(stderr=True)
    if console.is_terminal:
        with console.status(what):
            yield
    else:
        yield
