"""What the commands share: the option `--scale`, tables, JSON and a spinner."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from experiments.errors import InputError, counted

if TYPE_CHECKING:
    from analysis.report.contents import Contents, Picture
    from analysis.report.formats import Table


# What the commands on models and synthetic data share: tables, JSON, a spinner.


def refuse_unwritable(path: Path | None) -> Path | None:
    """Reject a file that cannot be written before the work begins."""
    from experiments.files import check_targets

    check_targets([path])
    return path


VerifyOption = Annotated[
    bool,
    typer.Option("--verify-with-r", help="Recompute the report's tables in R, and compare."),
]
LevelsOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Order of a factor's levels: time=before,after; or an experiment (exp1 to exp3, a demo, a TOML "
        "file), for its declared order, as in `analysis run`. Repeatable. Default: alphabetical, numbers by "
        "value."
    ),
]
JsonOption = Annotated[
    Path | None, typer.Option(help="Write every number to this JSON file.", callback=refuse_unwritable)
]


def names_in(text: str) -> list[str]:
    """Column names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


@dataclass
class ShownResult:
    """What a command shows, for a page: `analysis page` collects it next to what is printed."""

    sentences: list[str] = field(default_factory=list)
    decisions: list[str] = field(default_factory=list)
    tables: list["Table"] = field(default_factory=list)
    draw: list[Callable[[], "tuple[Picture, ...]"]] = field(default_factory=list)
    synthetic: bool = False


SHOWN: ContextVar[ShownResult | None] = ContextVar("SHOWN", default=None)
"""Where what is shown is also collected; None but in `analysis page`."""


def show_tables(*tables: "Table") -> None:
    """Print tables that have rows, at most 80 columns wide."""
    from analysis.report.formats import as_text

    for table in (table for table in tables if table.rows):
        typer.echo("\n" + as_text(table))
        if (shown := SHOWN.get()) is not None:
            shown.tables.append(table)


def show_text(text: str) -> None:
    """Print a sentence or several, in lines of at most 80 columns."""
    from analysis.report.formats import wrap

    typer.echo("\n".join(wrap(text)))
    if (shown := SHOWN.get()) is not None:
        shown.sentences.append(text)


def show_decisions(decisions: Sequence[str]) -> None:
    """Print what was decided while reading, in lines of at most 80 columns."""
    from analysis.report.formats import wrap

    for decision in decisions:
        typer.echo("\n".join(wrap(f"- {decision}")))
    if (shown := SHOWN.get()) is not None:
        shown.decisions += decisions


def show(contents: "Contents") -> None:
    """Print who was left out and the tables, at most 80 columns wide."""
    from analysis.report.formats import as_text, wrap

    lines = [contents.title, f"{counted(contents.n_participants, 'participant')}, from {contents.source}"]
    if contents.synthetic:
        lines.append(f"SYNTHETIC DATA: no person gave these {contents.given}")
    said = [*contents.left_out, *contents.decisions]
    lines += [part for text in said for part in wrap(f"- {text}")]
    typer.echo("\n".join(lines))
    if (shown := SHOWN.get()) is not None:
        shown.decisions += said
        for part in contents.parts:
            shown.sentences += part.sentences
            shown.tables += part.tables
            shown.draw.append(part.draw)
    for part in contents.parts:
        if part.title:
            typer.echo(f"\n{part.title}")
        for table in part.tables:
            if table.folded:
                folded = f"{table.title}: {counted(len(table.rows), 'row')}; see the report or the JSON file"
                typer.echo("\n" + "\n".join(wrap(folded)))
            else:
                typer.echo("\n" + as_text(table))


def save_json(path: Path | None, numbers: dict[str, Any], synthetic: bool | None = None) -> None:
    """Write numbers to a JSON file, whole or not at all; nothing where no path is given.

    Called before anything is printed: a reader like `head` that closes the pipe ends the command there.
    `synthetic` is put before numbers that do not say it.
    """
    from experiments.files import json_text, whole_file

    if (shown := SHOWN.get()) is not None:
        shown.synthetic = bool(numbers.get("synthetic", synthetic))
    if path is None:
        return
    said = {} if synthetic is None else {"synthetic": synthetic}
    with whole_file(path) as temporary:
        temporary.write_text(json_text({**said, **numbers}), encoding="utf-8")
    typer.echo(f"written: {path}")


def save_report(contents: "Contents", folder: Path, more: bool = False, with_r: bool = False) -> None:
    """Write the report; `more` adds slow parts, `with_r` recomputes its tables in R."""
    from analysis.report.formats import wrap
    from analysis.report.r_models import rscript, verify_with_r
    from analysis.report.write import write_report

    if with_r:
        rscript()
    with progress_spinner("writing") as say:
        paths = write_report(contents, folder, more, say)
    files = ", ".join(path.name for path in paths)
    typer.echo("\n".join(wrap(f"written to {folder}: {files}")))
    if with_r:
        for said in verify_with_r(paths, _say_model):
            typer.echo(said)


def _say_model(script: str) -> None:
    typer.echo(
        f"{script}: R fits the model again, which takes minutes; press Ctrl-C to leave it unverified",
        err=True,
    )


def show_figure(draw: "Callable[[], Picture]") -> None:
    """Keep what draws a figure, where figures are collected; a terminal shows none."""
    if (shown := SHOWN.get()) is not None:
        shown.draw.append(lambda: (draw(),))


def save_page(shown: ShownResult, folder: Path, command_line: str) -> None:
    """Write `page.json` (the command, sentences, decisions, tables) and the figures as SVG and PNG."""
    from experiments.files import json_text, whole_file

    pictures = [picture for draw in shown.draw for picture in draw()]
    page = {
        "command_line": command_line,
        "synthetic": shown.synthetic,
        "sentences": shown.sentences,
        "decisions": shown.decisions,
        "tables": [asdict(table) for table in shown.tables],
        "figures": [{"key": one.key, "caption": one.caption, "alt": one.alt} for one in pictures],
    }
    files = {"page.json": json_text(page).encode()}
    for one in pictures:
        files |= {f"{one.key}.svg": one.svg, f"{one.key}.png": one.png}
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(content)


@contextmanager
def progress_spinner(what: str) -> Iterator[Callable[[str], None]]:
    """A spinner on a terminal, silence elsewhere; gives a function that says which step is being taken."""
    # Loading rich takes a tenth of the time of an ANOVA whose output goes into a file.
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True, markup=False)
    if not console.is_terminal:
        yield lambda _: None
        return
    with console.status(Text(what)) as status:
        yield lambda step: status.update(Text(f"{what}: {step}"))


# The option `--scale 1:7`, which several commands take.


def scale_bounds(text: str | None) -> tuple[float, float] | None:
    """The ends of a scale; None where none was given."""
    if text is None:
        return None
    low, _, high = text.partition(":")
    try:
        bounds = float(low), float(high)
    except ValueError:
        bounds = (1.0, 0.0)
    if not bounds[0] < bounds[1]:
        raise InputError(f"--scale should be like 1:7, got '{text}'")
    return bounds


def equivalence_bounds(text: str | None) -> tuple[float, float] | None:
    """Bounds of equivalence from 0.5 or -0.3,0.5; None where none were given."""
    if text is None:
        return None
    try:
        given = [float(part) for part in text.split(",")]
    except ValueError:
        given = []
    if len(given) == 1:
        given = [-abs(given[0]), abs(given[0])]
    if len(given) != 2 or not given[0] < 0 < given[1]:
        raise InputError(f"--equivalence should be like 0.5 or -0.3,0.5, got '{text}'")
    return given[0], given[1]
